"""Score a navigator on worlds of the BARN benchmark. No server is needed.

python examples/trials/barn.py FOLDER [ALGORITHM [SENSOR]]

The folder has ``world_N.world`` of Gazebo and ``path_N.npy``, as the benchmark has them
(https://arxiv.org/abs/2008.13315). The robot starts before a field of cylinders and has
to get 10 m ahead in at most 100 s, without a touch. The score of a success is
OT / clip(AT, 2 OT, 8 OT): AT is the time of the run, and OT that of the published path
at 2 m/s. The benchmark stops the clock 1 m before the goal, and this at the goal.
"""

import json
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import radarsim

START, GOAL = (-2.25, 3.0), (-2.25, 13.0)  # m
CELL, ORIGIN = 0.15, (-4.575, 5.075)  # m; rows of paths are along x, columns along y
FLOOR = {"box": [20, 30, 0.2], "position": [0, 6, -0.1], "material": "concrete"}
RADARSIM = (sys.executable, "-m", "radarsim")


def optimal_time(path_file: Path) -> float:
    """Return the time of a published path at 2 m/s, s."""
    path = np.load(path_file, allow_pickle=False) * CELL + ORIGIN
    legs = np.diff(np.vstack([START, path, GOAL]), axis=0)
    return float(np.hypot(*legs.T).sum()) / 2.0


folder = Path(sys.argv[1])
algorithm = sys.argv[2] if len(sys.argv) > 2 else "planned"
sensor = sys.argv[3] if len(sys.argv) > 3 else "laser"
drive = ["--algorithm", algorithm, "--safety-distance", "0.5", "--time-limit", "100"]
drive += [f"--pose={START[0]},{START[1]},90", f"--goal={GOAL[0]},{GOAL[1]}", "--json"]
for setting in (f"sensor={sensor}", "fov_deg=359", "resolution_deg=1"):
    drive += ["--set", f"lms200.{setting}"]

scores = []
for world in sorted(folder.glob("world_*.world")):
    number = world.stem.removeprefix("world_")
    optimal = optimal_time(folder / f"path_{number}.npy")
    with TemporaryDirectory() as made:
        file = f"{made}/barn_{number}.yaml"
        subprocess.run([*RADARSIM, "import", world, "-o", file], check=True)
        # planes are not imported
        radarsim.load_map(file).with_object("floor", **FLOOR).to_yaml(file)
        command = [*RADARSIM, "navigate", file, *drive]
        run = subprocess.run(command, stdout=subprocess.PIPE, check=False)
    result = json.loads(run.stdout)
    outcome, touches = result["outcome"], result["judge"]["collisions"]
    success = outcome == "reached" and not touches
    actual = min(max(result["time"], 2 * optimal), 8 * optimal)
    scores.append(optimal / actual if success else 0.0)
    print(f"world {number}: {outcome}, {touches} touches, score {scores[-1]:.3f}")
print(f"{sum(map(bool, scores))} of {len(scores)} worlds, score {np.mean(scores):.3f}")
