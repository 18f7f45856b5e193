"""Compare what a laser and the radar see of a room behind bushes. No server is needed.

python examples/see_through_bushes.py
"""

import numpy as np

import radarsim

BUSHES_END = 1.7  # m, x of the far side of the bushes

scene = radarsim.load_map("foliage_room")
x, y, yaw = -7.79, 0.0, 0.0  # m, m, rad: in front of the bushes, facing them
for name in ("laser", "radar"):
    sensor = radarsim.load_sensor(name)
    scan = sensor.scan(scene, (x, y, yaw), radarsim.generator_for(0, name))
    behind = x + scan.ranges * np.cos(scan.angles) > BUSHES_END
    print(f"{name}: {behind.sum()} of {len(behind)} beams see through the bushes")
