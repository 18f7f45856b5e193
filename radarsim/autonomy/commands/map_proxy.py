"""``radarsim map --through`` and ``--watch``: map what another client drives."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import click

from radarsim.autonomy.commands.film import filmed
from radarsim.autonomy.commands.map_files import (
    MapCamera,
    MapFiles,
    MapOutput,
    save_map,
)
from radarsim.autonomy.commands.map_run import map_progress, print_result
from radarsim.autonomy.evaluation.mapping_run import MappingResult
from radarsim.autonomy.exploration.compilation import warm_up
from radarsim.autonomy.exploration.plans import ExplorationPlan
from radarsim.autonomy.proxy.observer import ScannerDefaults
from radarsim.autonomy.proxy.traffic_mapper import TrafficMapper
from radarsim.cli.output import print_message, start_log
from radarsim.errors import PortUnavailable, ServerError
from radarsim.geometry import Pose2, Pose3
from radarsim.processes import raise_on_signals

LISTEN: Final = "127.0.0.1"
_GUESS: Final = (
    "no client has asked where {!r} is mounted on the robot, and how far it sees;"
    " these are guessed, expected --mount and --max-range"
)


@dataclass(frozen=True, slots=True)
class FollowedMapping:
    """A map of what a robot reports that another client drives.

    Attributes:
        output: What is made of it.
        server: Host and port of the server.
        plan: The scanner, the source of its motion, and the map's cells.
        mount: Pose of the scanner on the robot, if the server does not tell it.
        max_range: Maximum range of the scanner, m, likewise.
    """

    output: MapOutput
    server: tuple[str, int]
    plan: ExplorationPlan
    mount: Pose2 | None
    max_range: float | None

    def run(self, port: int | None, robot: str | None) -> int:
        """Map what passes a port, or else what a robot's client is sent; see below.

        Args:
            port: Port to listen on; 0 for a free one, None to watch a robot.
            robot: Name of that robot.
        """
        if robot is not None:
            return self.watch(robot)
        return self.run_proxy(port or 0)

    def run_proxy(self, port: int) -> int:
        """Forward a port to the server until a signal comes, and map what passes.

        Args:
            port: Port to listen on; 0 for a free one.

        Returns:
            The exit code.

        Raises:
            ServerError: If the port is taken.
            click.BadParameter: If an option is wrong.
        """
        host, served = self.server
        if port == served and host in (LISTEN, "localhost", "0.0.0.0", "::1"):
            text = f"{port}, expected another port than the server's, see --connect"
            raise click.BadParameter(text, param_hint="--through")

        def forward(traffic: TrafficMapper) -> int:
            try:
                return traffic.run(self.server, (LISTEN, port), _announce)
            except PortUnavailable as error:
                raise ServerError(f"{error}; --through 0 takes a free one") from None

        return self._run(forward, "overheard", "")

    def watch(self, robot: str) -> int:
        """Watch a robot of radarsim until it leaves or a signal comes, and map it.

        Args:
            robot: Name of the robot.

        Returns:
            The exit code.

        Raises:
            click.BadParameter: If an option is wrong.
        """
        if not robot.strip() or "," in robot:
            text = f"{robot[:80]!r}, expected the name of a robot, without commas"
            raise click.BadParameter(text, param_hint="--watch")

        def tell_wait() -> None:
            print_message(f"waiting for the robot {robot[:80]!r}")

        def follow(traffic: TrafficMapper) -> int:
            return traffic.watch(self.server, robot, tell_wait, echoes=self.plan.echoes)

        return self._run(follow, "watched", robot)

    def _run(
        self, run: Callable[[TrafficMapper], int], outcome: str, robot: str
    ) -> int:
        """Let a function run a mapper, write the map, and return the exit code."""
        mount, plan = self.mount, self.plan
        on_body = None if mount is None else Pose3(mount.x, mount.y, 0, yaw=mount.yaw)
        traffic = TrafficMapper(
            motion_source=plan.motion_source,
            resolution=plan.resolution,
            map_range=plan.map_range,
            scanner=plan.scanner,
            defaults=ScannerDefaults(on_body, self.max_range),
        )
        traffic.on_guess = lambda name: print_message(_GUESS.format(name))
        output, recording = self.output, self.output.recording
        output.check()
        start_log(logging.WARNING, "%(message)s")
        warm_up()
        source = traffic.motion_source
        result = MappingResult(None, source, trip=traffic.trip, outcome=outcome)
        camera = MapCamera(result, traffic)
        with (
            raise_on_signals(),
            recording,
            filmed(output.film, camera.draw, output.film_speed) as update_film,
        ):
            traffic.on_data = recording.follow(robot)
            with map_progress(traffic) as update:

                def note_scan() -> None:
                    update("listening")
                    update_film(traffic.trip.time)
                    recording.add_map(traffic.mapper)

                traffic.on_scan = note_scan
                code = run(traffic)
            recording.add_map(traffic.mapper, last=True)
            _complete(result, traffic, output.files)
            print_result(result, as_json=output.as_json)
        return 1 if result.error else code


def _complete(result: MappingResult, traffic: TrafficMapper, files: MapFiles) -> None:
    """Write the map, and note what went wrong."""
    result.mapper, result.dropped = traffic.mapper, traffic.dropped
    save_map(result, files)
    if traffic.error and not result.error:
        result.error = traffic.error
        print_message(traffic.error)


def _announce(address: tuple[str, int]) -> None:
    print_message(f"listening on {address[0]}:{address[1]}")
