"""Robots in a scene: motion, readings and scans."""

import math
from collections import Counter

import numpy as np
import pytest
from tick_readings import readings_of, status_of

from radarsim.geometry import Pose2, Pose3
from radarsim.presets.robots import load_robot
from radarsim.protocol import reports
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.scene.scene import Scene
from radarsim.simulation.config import SimulationConfig
from radarsim.simulation.simulation import MAX_SHOWN, Simulation
from radarsim.simulation.tick_output import TickOutput
from radarsim.simulation.vehicle import Vehicle

STILL = {"sigma": 0, "position_bias": 0, "angle_bias": 0}
EXACT = SimulationConfig(
    item_settings={"lms200": {"side_offset_uu": 0}, "InsTest": STILL}
)
HALF_LENGTH, HALF_WIDTH = 0.276, 0.2485


def spawned(simulation: Simulation, pose: Pose2, name: str = "R1") -> Vehicle:
    vehicle = simulation.spawn(name, load_robot("P3AT"), pose)
    assert vehicle is not None
    return vehicle


def run(simulation: Simulation, ticks: int) -> dict[int, list[tuple[int, TickOutput]]]:
    """Let time pass and return the outputs of each robot with their ticks."""
    outputs: dict[int, list[tuple[int, TickOutput]]] = {}
    for _ in range(ticks):
        simulation.step()
        for number, output in simulation.collect_reports().items():
            outputs.setdefault(number, []).append((simulation.ticks, output))
    return outputs


def scan_after(simulation: Simulation, vehicle: Vehicle) -> reports.RangeScan:
    last = run(simulation, 10)[vehicle.number][-1][1]
    (scan,) = last.scans
    return scan


def test_intervals_start_at_the_spawn(empty_room: Scene) -> None:
    simulation = Simulation(empty_room)
    early = spawned(simulation, Pose2(-8, 0))
    run(simulation, 7)
    late = spawned(simulation, Pose2(-8, 3), "R2")
    outputs = run(simulation, 33)
    assert [t for t, output in outputs[early.number] if output.scans] == [
        10,
        20,
        30,
        40,
    ]
    assert [t for t, output in outputs[late.number] if output.scans] == [17, 27, 37]
    due = [t for t, output in outputs[late.number] if status_of(output)]
    assert due == [17, 27, 37]
    times = [output.scans[0].time for _, output in outputs[late.number] if output.scans]
    assert times == [0.17, 0.27, 0.37]


def test_scan_has_the_ranges_of_the_room_from_the_sensor(empty_room: Scene) -> None:
    simulation = Simulation(empty_room, config=EXACT)
    vehicle = spawned(simulation, Pose2(-8, 1, math.pi / 2))
    scan = scan_after(simulation, vehicle)
    assert scan.name == "lms200"
    assert (scan.resolution, scan.fov) == pytest.approx((math.radians(1), math.pi))
    # it looks north from 0.2085 m ahead: east is right and first, west is left and last
    assert scan.ranges[0] == pytest.approx(18.4)
    assert scan.ranges[90] == pytest.approx(6.4 - 1.2085)
    assert scan.ranges[-1] == pytest.approx(2.4)


def test_scans_show_other_robots_but_not_the_own_one(empty_room: Scene) -> None:
    simulation = Simulation(empty_room, config=EXACT)
    one = spawned(simulation, Pose2(-8, 0))
    other = spawned(simulation, Pose2(-5, 0, math.pi), "R2")
    outputs = run(simulation, 10)
    for vehicle in (one, other):
        (scan,) = outputs[vehicle.number][-1][1].scans
        assert scan.ranges[90] == pytest.approx(3 - 0.2085 - HALF_LENGTH)
        seen = np.flatnonzero(scan.ranges < 3)
        # as wide as the hull, at the distance of its front
        width = 2 * math.degrees(math.atan(HALF_WIDTH / (3 - 0.2085 - HALF_LENGTH)))
        assert len(seen) == pytest.approx(width, abs=1)
    simulation.remove(other)
    assert scan_after(simulation, one).ranges[90] == pytest.approx(18.4 - 0.2085)


def test_spawn_at_a_taken_place_uses_the_nearest_free_one(empty_room: Scene) -> None:
    simulation = Simulation(empty_room)
    spawned(simulation, Pose2(0, 0))
    pose = spawned(simulation, Pose2(0, 0), "R2").robot.pose
    assert 2 * HALF_WIDTH <= math.hypot(pose.x, pose.y) < 0.7
    assert pose.yaw == 0


def test_robot_names_are_unique(empty_room: Scene) -> None:
    simulation = Simulation(empty_room)
    made = [spawned(simulation, Pose2(-8 + 2 * k, 0), "R") for k in range(3)]
    assert [v.robot.name for v in made] == ["R", "R_2", "R_3"]
    simulation.remove(made[1])
    assert spawned(simulation, Pose2(0, 3), "R").robot.name == "R_2"


def test_robot_stops_at_a_wall_and_its_bumper_reports_touch(empty_room: Scene) -> None:
    simulation = Simulation(empty_room, config=EXACT)
    vehicle = spawned(simulation, Pose2(9, 0))
    vehicle.robot.drive(8, 8)
    outputs = run(simulation, 200)[vehicle.number]
    touches = [
        r.touched
        for _, output in outputs
        for r in readings_of(output)
        if isinstance(r, reports.Touch)
    ]
    assert touches[0] is False
    assert touches[-1] is True
    assert vehicle.robot.pose.x == pytest.approx(10.4 - HALF_LENGTH, abs=0.01)
    distances = [
        r.pose.x
        for _, output in outputs
        for r in readings_of(output)
        if isinstance(r, reports.Odometry)
    ]
    assert distances[-1] == pytest.approx(8 * 0.098 * 2)  # the wheels turn on


def test_readings_of_a_tick_describe_the_same_moment(empty_room: Scene) -> None:
    simulation = Simulation(empty_room, config=EXACT)
    vehicle = spawned(simulation, Pose2(-8, 0, 0.3))
    vehicle.robot.drive(3, 4)
    for tick, output in run(simulation, 100)[vehicle.number]:
        if not readings_of(output):
            continue
        truth, ins, odometry, tachometer = readings_of(output)[:4]
        assert isinstance(truth, reports.GroundTruth)
        assert isinstance(ins, reports.Ins)
        assert isinstance(odometry, reports.Odometry)
        assert isinstance(tachometer, reports.Tachometer)
        assert truth.time == ins.time == tick / 100
        assert ins.pose.numbers() == pytest.approx(
            np.add(truth.pose.numbers(), (0, 0, 0.2, 0, 0, 0))
        )
        start = Pose3(-8, 0, 0.146, yaw=0.3)
        moved = Pose3(odometry.pose.x, odometry.pose.y, 0, yaw=odometry.pose.yaw)
        assert start.compose(moved).numbers() == pytest.approx(truth.pose.numbers())
        assert tachometer.velocities == pytest.approx((4, 3, 4, 3))


def test_extra_scan_comes_with_the_next_tick_and_keeps_the_schedule(
    empty_room: Scene,
) -> None:
    simulation = Simulation(empty_room)
    vehicle = spawned(simulation, Pose2(-8, 0))
    (scanner,) = vehicle.model.items_of("rangescanner")
    run(simulation, 3)
    vehicle.request_scan(scanner)
    vehicle.request_scan(scanner)
    outputs = run(simulation, 17)[vehicle.number]
    assert [(t, len(output.scans)) for t, output in outputs if output.scans] == [
        (4, 1),
        (10, 1),
        (20, 1),
    ]
    run(simulation, 9)
    vehicle.request_scan(scanner)
    ((_, output),) = run(simulation, 1)[vehicle.number]
    first, second = output.scans
    assert first.ranges.tolist() != second.ranges.tolist()  # each draws its own rays


def test_requests_that_do_not_fit_an_item_have_no_effect(empty_room: Scene) -> None:
    simulation = Simulation(empty_room)
    vehicle = spawned(simulation, Pose2(-8, 0))
    for item in vehicle.model.items:
        if item.type not in ("RangeScanner", "INS"):
            vehicle.request_scan(item)
            vehicle.set_ins(item, Pose3(0, 0, 0))
    assert not run(simulation, 9)


@pytest.mark.parametrize(
    ("class_name", "dialect", "is_stamped"),
    [
        pytest.param("P2AT", COMPAT, False, id="P2AT"),
        pytest.param("P2DX", COMPAT, False, id="P2DX"),
        pytest.param("P3AT", COMPAT, True, id="P3AT"),
        pytest.param("P2AT", UDK, True, id="P2AT in udk"),
    ],
)
def test_odometry_of_the_older_robots_has_no_time_stamp(
    empty_room: Scene, class_name: str, dialect: Dialect, is_stamped: bool
) -> None:
    simulation = Simulation(empty_room, config=SimulationConfig(dialect))
    vehicle = simulation.spawn("R", load_robot(class_name), Pose2(-8, 0))
    assert vehicle is not None
    _, output = run(simulation, 20)[vehicle.number][-1]
    (reading,) = (r for r in readings_of(output) if isinstance(r, reports.Odometry))
    assert reading.time == 0.2 if is_stamped else math.isnan(reading.time)
    assert reading.encode(vehicle.dialect).startswith("SEN {Time ") is is_stamped


def test_reset_zeroes_odometry_and_wheel_counters(empty_room: Scene) -> None:
    simulation = Simulation(empty_room)
    vehicle = spawned(simulation, Pose2(-8, 0))
    vehicle.robot.drive(5, 5)
    run(simulation, 95)
    for item in vehicle.model.items:
        vehicle.reset(item)
    vehicle.robot.halt()
    readings = readings_of(run(simulation, 5)[vehicle.number][-1][1])
    odometry, tachometer = readings[2:4]
    assert isinstance(odometry, reports.Odometry)
    assert isinstance(tachometer, reports.Tachometer)
    assert (odometry.pose.x, odometry.pose.y, odometry.pose.yaw) == (0, 0, 0)
    assert tachometer.positions == (0, 0, 0, 0)
    assert [r.ticks for r in readings if isinstance(r, reports.Encoder)] == [
        (("W1", 0),),
        (("W2", 0),),
    ]


def test_ins_drift_is_drawn_by_simulated_time_at_any_rate(empty_room: Scene) -> None:
    simulation = Simulation(empty_room, seed=3)
    vehicle = spawned(simulation, Pose2(-8, 0))
    vehicle.robot.drive(5, 5)
    errors = []
    for _, output in run(simulation, 100)[vehicle.number]:
        if readings_of(output):
            truth, ins = readings_of(output)[:2]
            assert isinstance(truth, reports.GroundTruth)
            assert isinstance(ins, reports.Ins)
            errors.append(ins.pose.x - truth.pose.x)
    changes = np.flatnonzero(np.abs(np.diff([0.0, *errors])) > 1e-9)
    assert changes.tolist() == [1, 3, 5, 7, 9]  # every 0.2 s, at every second reading


def test_no_robot_is_spawned_inside_a_bush(foliage_room: Scene) -> None:
    simulation = Simulation(foliage_room)
    middle = Pose2(0.5, -1.64)  # of a bush of 1.2 m
    assert simulation.spawn("R1", load_robot("P3AT"), middle) is None
    edge = simulation.spawn("R2", load_robot("P3AT"), Pose2(-0.3, -1.64))
    assert edge is not None
    assert edge.robot.pose.x < 0.5 - 1.15


def test_robot_can_be_spawned_in_smoke(smoke_room: Scene) -> None:
    place = Pose2(-3.0, 0.0)
    vehicle = Simulation(smoke_room).spawn("R1", load_robot("P3AT"), place)
    assert vehicle is not None
    assert vehicle.robot.pose == place


def test_echoes_for_watchers_are_listed_in_turns(empty_room: Scene) -> None:
    simulation, robots = Simulation(empty_room), 2 * MAX_SHOWN + 1
    vehicles = [spawned(simulation, Pose2(k - 4, 3), f"R{k}") for k in range(robots)]
    asking, *watched = vehicles
    asking.scanners[0].sends_echoes = True
    for vehicle in watched:
        vehicle.shows_echoes = True
    outputs = run(simulation, 80)
    scans = sum(len(output.scans) for _, output in outputs[asking.number])
    listed = {
        number: [tick for tick, output in each if output.echoes]
        for number, each in outputs.items()
    }
    assert len(listed[asking.number]) == scans
    ticks = Counter(tick for v in watched for tick in listed[v.number])
    assert set(ticks.values()) == {MAX_SHOWN}
    assert {len(listed[v.number]) for v in watched} == {scans // 2}
