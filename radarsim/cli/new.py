"""``radarsim new``: a starter map."""

import shlex
from pathlib import Path
from typing import Annotated, Final

import typer

from radarsim.cli.options import check_ending, check_writable, write_file
from radarsim.cli.output import print_lines, program_name

STARTER_MAP: Final = Path(__file__).parents[1] / "scene" / "starter_map.yaml"


def new(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="The map file to write, such as room.yaml."
        ),
    ],
    random: Annotated[
        int | None,
        typer.Option(
            min=0,
            metavar="K",
            help="Write map K of those that `radarsim trials --random` runs on.",
        ),
    ] = None,
) -> None:
    """Write a small map to start your own from, with comments."""
    check_ending(file, ["yaml", "yml"], "FILE")
    check_writable(file, "FILE")
    if file.exists():
        text = f"{str(file)!r} exists, expected the name of a new file"
        raise typer.BadParameter(text, param_hint="FILE")
    write_file(file, _map_text(random), "FILE")
    name = shlex.quote(str(file))
    picture = shlex.quote(str(file.with_suffix(".png")))
    scan = f"scan {name} --sensor radar --start RobotStart1 -o {picture}"
    commands = (f"check {name}", scan, f"serve {name}")
    first = f"{file}: change it in an editor, then try"
    print_lines((first, *(f"  {program_name()} {command}" for command in commands)))


def _map_text(random: int | None) -> bytes:
    if random is None:
        return STARTER_MAP.read_bytes()
    from radarsim.scene.random_maps import make_random_map

    return make_random_map(random).as_yaml().encode()
