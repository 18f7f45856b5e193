"""Touches of a robot, as the truth has them."""

import math

from contacts import Contact, Contacts
from random_trials import load_random_map
from traffic import Mover, Traffic

from radarsim.autonomy.evaluation.navigation_run import GroundTruthMonitor
from radarsim.client import Client
from radarsim.generators.random_maps import Block, RandomMap
from radarsim.geometry import Pose2
from radarsim.server.host import Host
from radarsim.server.host.lockstep import InProcessTransport

YARD = RandomMap(0, "boxes", (), math.inf, (-5.0, 0.0), (5.0, 0.0))
WALL = Block(0.0, 0.0, 0.2, 4.0)


def test_contact_is_repeated_where_the_robot_stands_and_faces_as_before() -> None:
    first = Contact(Pose2(1.0, 1.0, 3.1))
    assert Contact(Pose2(1.1, 1.0, -3.1)).repeats(first)
    assert not Contact(Pose2(1.2, 1.0, 3.1)).repeats(first)
    assert not Contact(Pose2(1.0, 1.0, 2.0)).repeats(first)


def test_push_is_a_touch_that_lasts_or_is_repeated() -> None:
    yard = RandomMap(0, "boxes", (WALL,), math.inf, (-1.0, 0.0), (5.0, 0.0))
    host = Host(load_random_map(yard))
    monitor, contacts = GroundTruthMonitor(host), Contacts(host)
    with Client(InProcessTransport(host, after_tick=monitor.watch)) as client:
        client.spawn("P3AT", pose=Pose2(-1.0, 0.0))
        for speed, seconds in ((3.0, 2.5), (-3.0, 1.0), (3.0, 1.6), (-3.0, 1.0)):
            client.drive(speed, speed)
            end = host.simulation.time + seconds
            while host.simulation.time < end:
                client.read(0.1)
    assert monitor.collisions == len(contacts.found) == 2
    assert contacts.pushes == 1
    assert all(contact.duration < 1.0 for contact in contacts.found)


def test_movers_drive_to_and_fro_and_stop_before_the_robot() -> None:
    host = Host(load_random_map(YARD))
    mover = Mover(0.0, -2.0, math.pi / 2, 3.0, 0.5)
    traffic = Traffic(host, [mover])
    with Client(InProcessTransport(host, after_tick=traffic.step)) as client:
        client.spawn("P3AT", pose=Pose2(-3.0, 0.0))
        y, nearest = [], math.inf
        client.drive(2.0, 2.0)
        while host.simulation.time < 40.0:
            client.read(0.1)
            robot, *others = (each.robot for each in host.simulation.vehicles)
            for other in others:
                y.append(other.pose.y)
                pose = other.pose
                nearest = min(
                    nearest, math.hypot(pose.x - robot.pose.x, pose.y - robot.pose.y)
                )
            if robot.pose.x > -0.3:
                client.drive(0.0, 0.0)
            assert not robot.touched
    assert min(y) < -1.9
    assert max(y) < 1.1
    assert nearest > 0.5
