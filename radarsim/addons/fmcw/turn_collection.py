"""Whole turns of what the FMCW radar of a robot receives, sector by sector."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from radarsim.addons.fmcw.antennas import SeenSector, antennas_of
from radarsim.errors import ClientError, expected_one_of

if TYPE_CHECKING:
    from radarsim.addons.fmcw.spectrum import Spectrum
    from radarsim.simulation.simulation import Simulation
    from radarsim.simulation.vehicle import Vehicle


class TurnCollection:
    """Joins sectors.

    Attributes:
        newest: The last whole turn, from the pose at which it began; None before it.
    """

    def __init__(self) -> None:
        self.newest: Spectrum | None = None
        self._sectors: list[Spectrum] = []

    def take(self, seen: SeenSector) -> None:
        """Add what is received from neighbouring directions."""
        if seen.sector.first == 0:
            self._sectors.clear()  # of a turn that the antenna did not end
        elif not self._sectors:  # the turn began before anybody listened
            return
        self._sectors.append(seen.sector.spectrum)
        if seen.sector.ends_turn:
            self.newest = replace(
                self._sectors[0],
                angles=np.concatenate([each.angles for each in self._sectors]),
                power=np.concatenate([each.power for each in self._sectors]),
                echo_power=np.concatenate([each.echo_power for each in self._sectors]),
            )


def collect_turns(
    simulation: Simulation, vehicle: Vehicle, scanner: str | None
) -> TurnCollection:
    """Let the FMCW radar of a robot turn, and collect what it receives.

    Args:
        simulation: The simulation.
        vehicle: The robot.
        scanner: Name of the radar, in any case; None for the robot's first.

    Raises:
        ClientError: If the robot has no such FMCW radar.
    """
    antennas = antennas_of(simulation).of(vehicle)
    names = [each.mounted.item.name for each in antennas]
    for name, antenna in zip(names, antennas, strict=True):
        if scanner is None or name.casefold() == scanner.casefold():
            collection = TurnCollection()
            antenna.listeners.append(collection.take)
            return collection
    if scanner is None:
        text = f"robot {vehicle.robot.name!r} has no FMCW radar"
        raise ClientError(f"{text}, expected such as a P3AT_Navtech")
    raise ClientError(f"FMCW radar {expected_one_of(scanner, names)}")
