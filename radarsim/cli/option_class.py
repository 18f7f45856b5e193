"""Commands whose options are the fields of a dataclass, instead of many parameters."""

import inspect
from collections.abc import Callable
from dataclasses import MISSING, fields
from typing import Any, TypeVar, get_type_hints

_Options = TypeVar("_Options")


def with_options(
    options: type[_Options],
) -> Callable[[Callable[[_Options], None]], Callable[..., None]]:
    """Return a decorator that turns a function of a dataclass into a typer command.

    Args:
        options: The dataclass; its fields are annotated as parameters of commands are.
    """

    def decorate(run: Callable[[_Options], None]) -> Callable[..., None]:
        def command(**values: Any) -> None:
            run(options(**values))

        hints = get_type_hints(options, include_extras=True)
        parameters = [
            inspect.Parameter(
                field.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=inspect.Parameter.empty
                if field.default is MISSING
                else field.default,
                annotation=hints[field.name],
            )
            for field in fields(options)  # type: ignore[arg-type]
        ]
        command.__name__, command.__doc__ = run.__name__, run.__doc__
        command.__module__, command.__qualname__ = run.__module__, run.__qualname__
        command.__annotations__ = {each.name: each.annotation for each in parameters}
        command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        return command

    return decorate
