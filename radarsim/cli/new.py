"""``radarsim new``: a starter map."""

import shlex
from pathlib import Path
from typing import Annotated, Final

import click
from annotated_types import Ge

from radarsim.cli.files import check_ending, check_writable, write_file
from radarsim.cli.output import print_lines, program_name
from radarsim.plans import Option

STARTER_MAP: Final = Path(__file__).parents[1] / "scene" / "starter_map.yaml"


def new(
    file: Annotated[Path, Option(is_argument=True)],
    *,
    random: Annotated[int | None, Ge(0), Option(metavar="K")] = None,
) -> None:
    """Write a small map to start your own from, with comments.

    Args:
        file: The map file to write, such as room.yaml.
        random: Write map K of those that 'radarsim trials --random' runs on.
    """
    check_ending(file, ["yaml", "yml"], "FILE")
    check_writable(file, "FILE")
    if file.exists():
        text = f"{str(file)!r} exists, expected the name of a new file"
        raise click.BadParameter(text, param_hint="FILE")
    if random is None:
        data = STARTER_MAP.read_bytes()
    else:
        from radarsim.scene.random_maps import make_random_map

        data = make_random_map(random).as_yaml().encode()
    write_file(file, data, "FILE")
    name = shlex.quote(str(file))
    picture = shlex.quote(str(file.with_suffix(".png")))
    scan = f"scan {name} --sensor radar --start RobotStart1 -o {picture}"
    commands = (f"check {name}", scan, f"serve {name}")
    first = f"{file}: change it in an editor, then try"
    print_lines((first, *(f"  {program_name()} {command}" for command in commands)))
