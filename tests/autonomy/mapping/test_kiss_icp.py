"""The same scans given to KISS-ICP, a published odometry for laser scanners."""

import math
from pathlib import Path

import numpy as np
import pytest
from kiss_icp.config import KISSConfig
from kiss_icp.config.config import (
    AdaptiveThresholdConfig,
    DataConfig,
    MappingConfig,
    RegistrationConfig,
)
from kiss_icp.kiss_icp import KissICP
from office_map import office_map

from radarsim.autonomy.exploration.exploration import Exploration
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.mapping.scan import PlanarScan
from radarsim.autonomy.mapping.slam import Slam
from radarsim.autonomy.mapping.trajectory import Trajectory, trajectory_errors
from radarsim.autonomy.plans import ExplorationPlan
from radarsim.client import Client
from radarsim.geometry import Pose2
from radarsim.rng import generator_for
from radarsim.scene.map_file import load_map
from radarsim.server.host import Host
from radarsim.server.host.lockstep import InProcessTransport

pytestmark = pytest.mark.slow

IN_ROOM = (
    *((-2.5, -5.0), (-2.0, -5.0), (-2.0, 5.0), (-9.0, 5.0), (-9.0, -5.0)),
    *((-2.0, -5.0), (-2.0, 5.0), (-6.0, 0.0), (-4.0, -2.0), (-8.0, 0.0)),
)
# m; its default, a hundredth of its greatest range, is 1 m
VOXEL_SIZES = (0.1, 0.2, 0.5, 1.0)


def drive(
    map_file: str | Path, plan: ExplorationPlan, monkeypatch: pytest.MonkeyPatch
) -> tuple[Mapper, list[PlanarScan]]:
    """Drive with an INS, and return the mapper and all scans that it has matched."""
    matched: list[tuple[Slam, PlanarScan]] = []
    match = Slam.step

    def step(
        slam: Slam, scan: PlanarScan, prior: Pose2 | None = None, guessed: float = 0.0
    ) -> Pose2:
        matched.append((slam, scan))
        return match(slam, scan, prior, guessed)

    monkeypatch.setattr(Slam, "step", step)
    exploration = Exploration(plan, generator_for(1, "exploring"))
    with Client(InProcessTransport(Host(load_map(map_file), seed=1))) as client:
        exploration.run(client)
    mapper = exploration.mapper
    assert mapper is not None
    return mapper, [scan for slam, scan in matched if slam is mapper.slam]


def by_kiss_icp(scans: list[PlanarScan], start: Pose2, voxel_size: float) -> Trajectory:
    config = KISSConfig(
        data=DataConfig(deskew=False),  # a scan is of one instant
        mapping=MappingConfig(voxel_size=voxel_size),
        registration=RegistrationConfig(max_num_threads=1),  # for the same sums
        # Its own are for cars: 2 m from scan to scan, and at least 0.1 m.
        adaptive_threshold=AdaptiveThresholdConfig(
            initial_threshold=0.5, min_motion_th=0.02
        ),
    )
    odometry, trajectory = KissICP(config), Trajectory()
    for scan in scans:
        points, _ = scan.points(sure=False)
        frame = np.column_stack([points, np.zeros(len(points))])
        odometry.register_frame(frame, np.zeros(0))
        pose = odometry.last_pose
        yaw = math.atan2(pose[1, 0], pose[0, 0])
        moved = start.compose(Pose2(float(pose[0, 3]), float(pose[1, 3]), yaw))
        trajectory.add(scan.time, moved)
    return trajectory


@pytest.mark.timeout(1200)
@pytest.mark.parametrize("place", ["foliage_room", "office"])
def test_poses_are_several_times_as_accurate_as_those_of_kiss_icp(
    tmp_path: Path, place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither gets the motion between scans, and both match the same points."""
    map_file: str | Path = place
    plan = ExplorationPlan(waypoints=IN_ROOM, speed=0.6)
    if place == "office":
        map_file, plan = tmp_path / "office.yaml", ExplorationPlan(safety_distance=0.38)
        map_file.write_text(office_map(1.2))
    mapper, scans = drive(map_file, plan, monkeypatch)
    start = mapper.trajectory.poses[0]
    slam = Slam("none", start)
    for scan in scans:
        slam.step(scan)
    assert len(slam.trajectory) == len(scans) > 1000
    with_ins = trajectory_errors(mapper.trajectory, mapper.truth)
    own = trajectory_errors(slam.trajectory, mapper.truth)
    others = [
        trajectory_errors(by_kiss_icp(scans, start, size), mapper.truth)
        for size in VOXEL_SIZES
    ]
    best = min(others, key=lambda errors: errors["ate"])
    assert own["length"] > 60
    assert with_ins["ate"] < 0.03
    assert own["ate"] < 0.05
    assert own["ate"] < 0.5 * best["ate"]
    assert own["yaw"] < 0.5 * best["yaw"]
