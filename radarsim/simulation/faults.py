"""Errors of single robots, which only a bug can cause: they end no tick."""

from collections.abc import Callable
from typing import TYPE_CHECKING, ParamSpec, TypeVar

if TYPE_CHECKING:
    from radarsim.simulation.vehicle import Vehicle

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


class Faults:
    """The robots in which something has failed.

    Attributes:
        errors: The errors by the robot's number; whoever steps the simulation raises
            them, or removes these robots.
    """

    def __init__(self) -> None:
        self.errors: dict[int, Exception] = {}

    def call(
        self,
        vehicle: "Vehicle",
        function: Callable[Arguments, Result],
        *args: Arguments.args,
        **kwargs: Arguments.kwargs,
    ) -> Result | None:
        """Call a function for a robot; keep its error and return None if it fails."""
        try:
            return function(*args, **kwargs)
        except Exception as error:  # noqa: BLE001 - a bug of one robot ends no other
            self.errors[vehicle.number] = error
            return None
