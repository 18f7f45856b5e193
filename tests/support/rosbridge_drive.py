"""Program: drive a robot by roslibpy, and print what it heard as JSON.

Arguments: the port of rosbridge. Needs roslibpy.
"""

import json
import os
import sys
import time
from typing import Any

HEARD = {
    "scans": ("/R1/lms200/scan", "sensor_msgs/msg/LaserScan"),
    "poses": ("/R1/ground_truth", "geometry_msgs/msg/PoseStamped"),
}


def main() -> None:
    import roslibpy

    ros = roslibpy.Ros("127.0.0.1", int(sys.argv[1]))
    ros.run(timeout=60)
    heard: dict[str, list[Any]] = {key: [] for key in HEARD}
    for key, (topic, type_) in HEARD.items():
        roslibpy.Topic(ros, topic, type_).subscribe(heard[key].append)
    wheels = roslibpy.Topic(ros, "/R1/cmd_vel", "geometry_msgs/msg/Twist")
    wheels.advertise()
    until = time.monotonic() + 2
    while time.monotonic() < until:
        wheels.publish({"linear": {"x": 0.3}, "angular": {"z": 0.0}})
        time.sleep(0.1)
    time.sleep(8)  # the dead man stops it
    result = {"topics": ros.get_topics(), **heard}
    sys.stdout.write(json.dumps(result))
    sys.stdout.flush()
    os._exit(0)  # its threads have no end


if __name__ == "__main__":
    main()
