"""Compare navigators on random maps, which nobody tuned them to. No server is needed.

python examples/trials/random_maps.py [MAPS [ALGORITHM,...]]

Radar and laser run on each map; ``radarsim trials`` judges them by the exact shortest
path of a disc as wide as the robot's diagonal.
"""

import json
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from radarsim.generators.random_maps import make_random_map

count = int(sys.argv[1]) if len(sys.argv) > 1 else 14
algorithms = sys.argv[2] if len(sys.argv) > 2 else "bug2,planned"

families: dict[str, str] = {}  # of map files
with TemporaryDirectory() as folder:
    for number in range(count):
        map_ = make_random_map(number)
        file = Path(folder) / f"map_{number}.yaml"
        file.write_text(map_.as_yaml())
        families[str(file)] = map_.family
    command = [sys.executable, "-m", "radarsim", "trials", *families, "--json"]
    options = ["--algorithms", algorithms, "--sensors", "radar,laser", "--seeds", "1"]
    trials = json.loads(subprocess.check_output([*command, *options]))

groups: dict[tuple[str, str], list[dict[str, Any]]] = defaultdict(list)
for trial in trials:
    groups[families[trial["map"]], trial["algorithm"]].append(trial)
for (family, algorithm), group in sorted(groups.items()):
    right = 0
    for trial in group:
        has_path = trial["shortest_path"] is not None
        right += trial["outcome"] == ("reached" if has_path else "no_path")
    touches = sum(trial["collisions"] for trial in group)
    print(f"{family} {algorithm}: {right} of {len(group)} right, {touches} touches")
