"""Problems of a map that is valid: occupied starts, and trials that cannot succeed."""

import math

from radarsim.evaluation.free_space import is_connected
from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot
from radarsim.scene.scene import Scene
from radarsim.simulation.simulation import Simulation


def occupied_starts(scene: Scene) -> list[str]:
    """Return a line for each start where a P3AT cannot be spawned exactly."""
    lines = []
    simulation = Simulation(scene)
    for start in scene.starts:
        wanted = Pose2(start.pose.x, start.pose.y, start.pose.yaw)
        model = load_robot("P3AT")
        vehicle = simulation.spawn("check", model, wanted)
        if vehicle is not None:
            simulation.remove(vehicle)  # robots must not occupy each other's starts
            if vehicle.robot.pose == wanted:
                continue
        in_way = simulation.hindrances(model, wanted)
        taken = f"{start.name}: taken by {', '.join(in_way) or 'what is above it'}"
        if vehicle is None:
            lines.append(f"{taken}; no place for a P3AT within 1 m")
        else:
            pose = vehicle.robot.pose
            position = f"x {pose.x:.2f} m, y {pose.y:.2f} m"
            lines.append(f"{taken}; a P3AT would stand at {position}")
    return lines


def trial_warnings(scene: Scene) -> list[str]:
    """Return a line for each reason why a robot cannot pass the map's trial."""
    trial = scene.trial
    if trial is None or (start := scene.start(trial.start)) is None:
        return []
    model, lines = load_robot("P3AT"), []
    clearance = math.hypot(model.length, model.width) / 2
    if trial.safety_distance < clearance:
        lines.append(f"a P3AT keeps at least {clearance:.3f} m")
    position = start.pose.x, start.pose.y
    if not is_connected(scene, position, trial.goal, trial.safety_distance):
        distance = f"{trial.safety_distance:g} m from everything solid"
        lines.append(f"no path to the goal that keeps {distance}")
    return lines
