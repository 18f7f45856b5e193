"""What comes and goes while a robot explores, and what is told of floor behind it."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flat_world import box, look
from office_map import office_map
from traffic import Mover, Traffic

from radarsim.autonomy.evaluation.mapping_run import MappingRun
from radarsim.autonomy.exploration.path_follower import (
    WAITING,
    ExplorationSettings,
    Strategy,
)
from radarsim.autonomy.exploration.revisit import LOOK_TIME, Revisit
from radarsim.autonomy.mapping.occupancy_grid import OccupancyGrid
from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.control import STOP, Twist
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.plans import ExplorationPlan, StrategyName
from radarsim.client import Client
from radarsim.geometry import Floats, Pose2
from radarsim.scene.map_file import load_map
from radarsim.server.host import Host
from radarsim.server.host.lockstep import InProcessTransport

SETTINGS = ExplorationSettings(bumpers=Bumpers(safety_distance=0.4))
HERE = Pose2(0.0, 0.0)
# A room with a door of 2 m, through which the robot sees 2 m of a larger one.
WALLS: Floats = np.concatenate(
    [
        box(0, 0, 8, 6)[[0, 2, 3]],
        [[[4, -3], [4, -1]], [[4, 1], [4, 3]]],
        box(14, 0, 20, 20)[:3],
    ]
)
CRATE = box(4.0, 0.0, 0.5, 0.8)


class UntilDone(Strategy):
    """Stands until it is told that it is done."""

    activity = "standing"

    def _decide(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        del observation, grid
        return STOP


class Stand:
    """A robot that stands, and whatever is around it."""

    def __init__(self) -> None:
        self.grid, self.other = OccupancyGrid(), UntilDone(SETTINGS)
        self.strategy = Revisit(SETTINGS, self.other, fills=False)
        self.time = 0.0

    def watch(self, walls: Floats, duration: float) -> None:
        for _ in range(round(duration / 0.1)):
            scan = look(walls, HERE, time=self.time).within(6.0)
            self.grid.add(HERE, scan)
            seen = Observation(self.time, HERE, scan.angles, scan.known_range)
            self.strategy.step(seen, self.grid)
            self.time += 0.1


SHUT: Floats = np.concatenate([WALLS, CRATE])


def test_what_has_closed_a_door_is_looked_at_until_it_has_gone() -> None:
    stand = Stand()
    stand.watch(WALLS, 3.0)
    stand.watch(SHUT, 8.0)
    stand.other.is_done = True
    stand.watch(SHUT, 5.0)
    assert stand.strategy.activity == WAITING
    assert not stand.strategy.is_done
    stand.watch(WALLS, 6.0)
    assert stand.strategy.activity == "frontier"
    assert not stand.strategy.is_done


def test_floor_behind_what_stays_is_told() -> None:
    stand = Stand()
    stand.watch(WALLS, 3.0)
    stand.watch(SHUT, 8.0)
    stand.other.is_done = True
    stand.watch(SHUT, LOOK_TIME + 3.0)
    assert stand.strategy.is_done
    assert stand.strategy.unreached
    assert all(x > 4.0 for x, _ in stand.strategy.unreached)
    # It has moved, so that it is no wall; walls are.
    assert not stand.grid.drivable(3.75, 0.0, 0.2)
    walls = stand.grid.blocked_cells()
    stand.strategy.forget_moved(stand.grid)
    assert stand.grid.drivable(3.75, 0.0, 0.2)
    gone = np.argwhere(walls & ~stand.grid.blocked_cells())
    row, column = stand.grid.frame.cell(4.0, 0.0) or (0, 0)
    assert np.abs(gone - (row, column)).max() < 20


def test_what_was_closed_from_the_beginning_is_a_wall() -> None:
    stand = Stand()
    stand.watch(SHUT, 3.0)
    stand.other.is_done = True
    stand.watch(SHUT, 0.2)
    assert stand.strategy.is_done
    assert not stand.strategy.unreached
    walls = stand.grid.blocked_cells()
    stand.strategy.forget_moved(stand.grid)
    assert (stand.grid.blocked_cells() == walls).all()


class RunAmongMovers(MappingRun):
    """A mapping run while other robots drive."""

    def __init__(self, host: Host, movers: list[Mover], **plan: Any) -> None:
        super().__init__(ExplorationPlan(safety_distance=0.38, **plan), host)
        self._traffic = Traffic(host, movers)
        self._served = host

    def _open_client(self, connect: Callable[[], Client]) -> Client:
        client = super()._open_client(connect)
        monitor = self.result.monitor
        assert monitor is not None

        def after_tick() -> None:
            monitor.watch()
            self._traffic.step()

        del client
        return Client(InProcessTransport(self._served, after_tick=after_tick))


@pytest.mark.slow
def test_movers_in_doors_are_no_walls_and_the_map_is_whole_or_said_not_to_be(
    tmp_path: Path,
) -> None:
    path = tmp_path / "office.yaml"
    path.write_text(office_map(1.2))
    movers = [
        Mover(4.3, 0.2, np.pi / 2, 3.0, 0.3),
        Mover(0.0, -3.2, np.pi / 2, 3.0, 0.3),
        Mover(-4.3, 0.3, np.pi / 2, 2.6, 0.4),
    ]
    made = RunAmongMovers(
        Host(load_map(path), seed=1),
        movers,
        strategy=StrategyName.FRONTIERS,
        time_limit=900,
    )
    made.run()
    made.judge()
    told = json.loads(made.result.to_json())
    judge = told["judge"]
    assert judge["collisions"] == 0
    assert judge["misplaced"] < 0.005
    assert judge["reachable_coverage"] > 0.9
    if judge["reachable_coverage"] < 0.98:
        assert told["outcome"] == "incomplete"
