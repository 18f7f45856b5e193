"""Make the pictures of the README: python .readme/make.py, with radarsim installed."""

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

import radarsim

FOLDER = Path(__file__).parent
EXAMPLES = FOLDER.parent / "examples"
PLANTS = EXAMPLES / "thesis" / "calibrate_plants.py"
SWEEP_FIGURE = (
    *(EXAMPLES / "sweeps" / "figure.py", "sweep/rows.parquet", "sweep/figure.png"),
    *("map=thickness of the hedge, cm", "sensor.name=sensor", "4"),
)
WIDTH = 1200  # pixels
COLOURS = 256
COMMANDS = (
    "radarsim demo demo.png",
    "radarsim scan foliage_room --sensor radar --start RobotStart1 -o scan.png",
    "radarsim navigate bug_u_trap --algorithm bug2 --plot navigate.png",
    "radarsim map foliage_room -o map/",
    "radarsim sweep foliage_thickness -o sweep",
)
PICTURES = {
    "demo": "demo.png",
    "scan": "scan.png",
    "orchard": "orchard.png",
    "navigate": "navigate.png",
    "map": "map/map_view.png",
    "sweep": "sweep/figure.png",
    "shrub_shapes": "plants/shrub_shapes.png",
    "commander": "commander.png",
}


def shrink(source: Path, target: Path) -> None:
    """Write a picture of at most WIDTH pixels across, in a palette."""
    picture = Image.open(source).convert("RGB")
    if picture.width > WIDTH:
        height = round(picture.height * WIDTH / picture.width)
        picture = picture.resize((WIDTH, height), Image.Resampling.LANCZOS)
    # by coverage, as the median cut leaves steps where rays lie close together
    picture = picture.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=4)
    picture.save(target, optimize=True)


def main() -> None:
    """Run the commands in a temporary folder and keep their pictures."""
    with tempfile.TemporaryDirectory() as folder:
        for command in COMMANDS:
            words = (sys.executable, "-m", *command.split())
            subprocess.run(words, cwd=folder, check=True)
        subprocess.run((sys.executable, *SWEEP_FIGURE), cwd=folder, check=True)
        subprocess.run((sys.executable, FOLDER / "commander.py", folder), check=True)
        drive = FOLDER / "drive.py", FOLDER / "drive.gif"
        subprocess.run((sys.executable, *drive), check=True)
        subprocess.run((sys.executable, PLANTS), cwd=folder, check=True)
        figure = radarsim.compare("orchard", "physical", "navtech_cir204h")
        figure.savefig(Path(folder, "orchard.png"))
        for name, picture in PICTURES.items():
            shrink(Path(folder, picture), FOLDER / f"{name}.png")


if __name__ == "__main__":
    main()
