"""Drive a robot with a laser towards the bushes, and stop half a metre before them.

radarsim serve foliage_room
python examples/stop_before_obstacles.py [PORT]
"""

import sys

import numpy as np

from radarsim.client import Client, beam_angles
from radarsim.protocol.reports import GroundTruth, RangeScan

AHEAD = 0.2  # rad to each side
DISTANCE = 0.5  # m between the robot and the obstacle ahead

port = int(sys.argv[1]) if len(sys.argv) > 1 else 3000
with Client.connect("127.0.0.1", port, timeout=120.0) as client:
    client.spawn("P3AT_SICK", start="RobotStart1")
    robot = client.robot_info()  # size, wheels and scanners, as the server reports them
    client.drive(*robot.wheel_speeds(0.8, 0.0))  # m/s ahead, rad/s counter-clockwise
    while True:
        scan = client.wait_for(RangeScan, name=robot.scanner().name)
        ahead = scan.ranges[np.abs(beam_angles(scan)) < AHEAD]
        if ahead.min() < robot.clearance + DISTANCE:
            break
    client.stop()
    pose = client.wait_for(GroundTruth).pose
    print(f"stopped at x {pose.x:.1f} m, {ahead.min():.1f} m before what is ahead")
