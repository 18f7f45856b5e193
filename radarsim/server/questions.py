"""What programs beside the clients ask about a simulation, and the answers.

Obstacles between two places are counted as bodies that stop robots: a ray from one to
the other enters volumes, and meets the surfaces of what is opaque, of which two of the
same body are one obstacle. Robots do not count, as in the original.
"""

from collections import Counter
from collections.abc import Callable
from typing import Final, TypeAlias

import numpy as np

from radarsim.errors import MalformedMessage
from radarsim.geometry import Pose3
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.message import Triple
from radarsim.protocol.truth import END, VICTIM, ActorTruth, TruthRequest
from radarsim.protocol.wireless import Station, WirelessRequest
from radarsim.raycast.attenuation import EventKind
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.scene.scene import Scene
from radarsim.simulation.simulation import Simulation

Answer: TypeAlias = Callable[[Simulation | None, str], bytes]
MOST_SURFACES: Final = 64  # that a ray goes through, so that a question ends
STEP: Final = 1e-3  # m behind a surface where a ray goes on
FARTHEST: Final = 1e4  # m; nothing of a scene is that far away


def truth_answer(dialect: Dialect) -> Answer:
    """Return what answers questions of USARTruth."""

    def answer(simulation: Simulation | None, line: str) -> bytes:
        try:
            request = TruthRequest.decode(line)
        except MalformedMessage:
            return END
        if simulation is None:
            return END
        actors = [
            ActorTruth(v.robot.name, v.model.name, v.robot.body)
            for v in simulation.vehicles
        ]
        actors += [
            ActorTruth(v.name, VICTIM, Pose3(*v.position, yaw=v.yaw))
            for v in simulation.scene.victims
        ]
        return request.answer(actors, simulation.time, dialect)

    return answer


def wireless_answer(dialect: Dialect) -> Answer:
    """Return what answers questions of a wireless server."""

    def answer(simulation: Simulation | None, line: str) -> bytes:
        if not line:
            return b""
        vehicles = () if simulation is None else simulation.vehicles
        stations = [
            Station(v.robot.name, v.robot.body.numbers()[:3], not v.alive)
            for v in vehicles
        ]

        def count(start: Triple, end: Triple) -> int:
            if simulation is None:
                return 0
            return count_obstacles(simulation.scene, start, end)

        try:
            request = WirelessRequest.decode(line)
            if request is not None:
                return request.answer(stations, count, dialect)
        except MalformedMessage:
            pass
        return b"\r\n"  # as the original, so that nobody waits for a line

    return answer


def count_obstacles(scene: Scene, start: Triple, end: Triple) -> int:
    """Return how many bodies are on the straight line between two places."""
    tracer, place = tracer_of(scene), np.clip(start, -FARTHEST, FARTHEST)
    offset = np.clip(end, -FARTHEST, FARTHEST) - place
    left = float(np.linalg.norm(offset))
    direction = offset / max(left, STEP)
    volumes, surfaces = 0, Counter[int]()
    while left > STEP and surfaces.total() < MOST_SURFACES:
        rays = Rays.uniform(place[None], direction[None], max_range=left)
        (events,) = tracer.explain(rays)
        solid = [each for each in events if scene.parts[each.part].material.solid]
        volumes += sum(each.kind == EventKind.ENTER for each in solid)
        last = events[-1]
        if last.kind != EventKind.HIT:
            break
        surfaces[last.part] += 1
        step = last.t + STEP
        place, left = place + step * direction, left - step
    return volumes + sum(-(-count // 2) for count in surfaces.values())
