"""Program: drive a robot by roslibpy, and print what it heard as JSON.

Arguments: the port of rosbridge, and for how long to listen, simulated seconds. It
drives half a metre, sends no more, and listens on until the robot stands.
"""

import json
import os
import sys
import threading
from typing import Any

import roslibpy

HEARD = {
    "scans": ("/R1/lms200/scan", "sensor_msgs/msg/LaserScan"),
    "poses": ("/R1/ground_truth", "geometry_msgs/msg/PoseStamped"),
}
FORWARD = {"linear": {"x": 0.3}, "angular": {"z": 0.0}}
TIMEOUT = 240.0  # s that a busy machine may need


def main() -> None:
    port, seconds = int(sys.argv[1]), float(sys.argv[2])
    ros = roslibpy.Ros("127.0.0.1", port)
    ros.run(timeout=TIMEOUT)
    heard: dict[str, list[Any]] = {key: [] for key in HEARD}
    wheels = roslibpy.Topic(ros, "/R1/cmd_vel", "geometry_msgs/msg/Twist")
    wheels.advertise()
    is_complete = threading.Event()

    def note_pose(pose: Any) -> None:
        poses = heard["poses"]
        poses.append(pose)
        if x_of(poses[-1]) < x_of(poses[0]) + 0.5:
            wheels.publish(FORWARD)
        elif x_of(poses[-1]) == x_of(poses[-2]) and has_heard(heard["scans"], seconds):
            is_complete.set()

    topics = [roslibpy.Topic(ros, *each) for each in HEARD.values()]
    topics[0].subscribe(heard["scans"].append)
    topics[1].subscribe(note_pose)
    assert is_complete.wait(TIMEOUT)
    answers = {"topics": ros.get_topics(), "time": ros.get_time().to_sec()}
    sys.stdout.write(json.dumps({**answers, **heard}))
    sys.stdout.flush()
    os._exit(0)  # its threads have no end


def x_of(pose: Any) -> float:
    return float(pose["pose"]["position"]["x"])


def time_of(message: Any) -> float:
    stamp = message["header"]["stamp"]
    return float(stamp["sec"] + stamp["nanosec"] / 1e9)


def has_heard(scans: list[Any], seconds: float) -> bool:
    """Return whether scans cover so much simulated time."""
    return bool(scans) and time_of(scans[-1]) - time_of(scans[0]) >= seconds


if __name__ == "__main__":
    main()
