"""``radarsim import``: maps and robot classes from files of other programs."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from radarsim.cli.options import (
    check_ending,
    check_positive,
    check_writable,
    read_pose,
    write_file,
)
from radarsim.cli.output import print_lines, print_message
from radarsim.errors import expected_one_of

if TYPE_CHECKING:
    from radarsim.addons.imports.imported_map import ImportedMap, ImportOptions


class Kind(StrEnum):
    """Kinds of files."""

    MAP_SERVER = "map_server"
    SDF = "sdf"
    STAGE = "stage"
    GLTF = "gltf"
    INI = "ini"


_ENDINGS = {
    ".yaml": Kind.MAP_SERVER,
    ".yml": Kind.MAP_SERVER,
    ".sdf": Kind.SDF,
    ".glb": Kind.GLTF,
    ".gltf": Kind.GLTF,
    ".ini": Kind.INI,
}

FileArgument = Annotated[Path, typer.Argument(metavar="FILE", help="The file.")]
OutOption = Annotated[
    Path, typer.Option("-o", "--output", metavar="FILE", help="The file to write.")
]
KindOption = Annotated[
    Kind | None,
    typer.Option(
        "--from", help="Kind of the file.", show_default="by its ending and content"
    ),
]
MaterialOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="PATTERN=NAME",
        help="Material of objects with such names, as '*hedge*=hedge'; repeat it, the"
        " first that fits counts.",
    ),
]
DefaultMaterialOption = Annotated[
    str, typer.Option(metavar="NAME", help="Material of all else.")
]
WallHeightOption = Annotated[
    float,
    typer.Option(
        metavar="M", callback=check_positive, help="Height of the walls of plans."
    ),
]
ModelPathOption = Annotated[
    list[Path] | None,
    typer.Option(
        metavar="DIR",
        help="Folder with models or files that worlds include; repeat it.",
    ),
]
StartOption = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y,YAW_DEG",
        help="Pose of the start, m.",
        show_default="where a plan has most room, else the origin",
    ),
]
RobotOption = Annotated[
    str | None,
    typer.Option(
        metavar="CLASS", help="Robot class to import, where a file has several."
    ),
]
StrictOption = Annotated[
    bool,
    typer.Option(
        "--strict", help="Write nothing, and exit with 1, if anything is left out."
    ),
]


def import_(
    file: FileArgument,
    *,
    output: OutOption,
    kind: KindOption = None,
    material: MaterialOption = None,
    default_material: DefaultMaterialOption = "concrete",
    wall_height: WallHeightOption = 2.0,
    model_path: ModelPathOption = None,
    start: StartOption = None,
    robot: RobotOption = None,
    strict: StrictOption = False,
) -> None:
    """Make a map, or a robot class, of a file of another program."""
    check_ending(output, ["yaml", "yml"], "-o")
    check_writable(output, "-o")
    if output.exists():
        text = f"{str(output)!r} exists, expected the name of a new file"
        raise typer.BadParameter(text, param_hint="-o")
    from radarsim.addons.imports.imported_map import ImportOptions

    options = ImportOptions(
        materials=dict(_read_pattern(text) for text in material or ()),
        default_material=default_material,
        wall_height=wall_height,
        model_paths=tuple(model_path or ()),
        start=None if start is None else _read_start(start),
    )
    kind = kind or _kind_of(file)
    warnings: list[str] = []
    if kind is Kind.INI:
        text, notes = _import_robot(file, robot)
    else:
        imported = _import(kind, file, options, output.parent)
        _check_materials(options, imported)
        text, notes = imported.to_text(output), imported.notes
        warnings = imported.warnings()
    if notes:
        print_lines(notes)
        if strict:
            raise typer.Exit(1)
    for warning in warnings:
        print_message(warning)
    write_file(output, text.encode(), "-o")
    print_message(f"wrote {output}")


def _import(
    kind: Kind, file: Path, options: ImportOptions, folder: Path
) -> ImportedMap:
    match kind:
        case Kind.MAP_SERVER:
            from radarsim.addons.imports.map_server import import_map_server

            return import_map_server(file, options)
        case Kind.SDF:
            from radarsim.addons.imports.sdf import import_sdf

            return import_sdf(file, options, folder)
        case Kind.STAGE:
            from radarsim.addons.imports.stage import import_stage

            return import_stage(file, options)
        case Kind.GLTF:
            from radarsim.addons.imports.gltf import import_gltf

            return import_gltf(file, options, folder)
        case Kind.INI:
            raise AssertionError("it has no map")


def _check_materials(options: ImportOptions, imported: ImportedMap) -> None:
    """Refuse materials of options that neither the library nor the file has."""
    from radarsim.scene.material import library_names

    known = [*library_names(), *imported.materials]
    named = {"--default-material": [options.default_material]}
    named["--material"] = list(options.materials.values())
    for hint, names in named.items():
        for name in names:
            if name not in known:
                text = f"material {expected_one_of(name, known)}"
                raise typer.BadParameter(text, param_hint=hint)


def _import_robot(file: Path, name: str | None) -> tuple[str, list[str]]:
    """Return the file of a robot class, and what is left out."""
    from radarsim.addons.imports.usarsim_ini import import_ini
    from radarsim.simulation.config import SimulationConfig

    imported = import_ini(file, name)
    SimulationConfig(robots=(imported.model,)).check()
    return imported.to_text(), imported.notes


def _kind_of(file: Path) -> Kind:
    ending = file.suffix.lower()
    if ending == ".world":  # of Gazebo, or of Stage
        from radarsim.addons.imports.sdf import is_xml

        return Kind.SDF if is_xml(file) else Kind.STAGE
    kind = _ENDINGS.get(ending)
    if kind is None:
        text = f"{str(file)!r}, expected --from with it"
        raise typer.BadParameter(text, param_hint="FILE")
    return kind


def _read_pattern(text: str) -> tuple[str, str]:
    pattern, sign, name = text.partition("=")
    if not (pattern and sign and name):
        expected = "expected PATTERN=NAME"
        raise typer.BadParameter(f"{text!r}, {expected}", param_hint="--material")
    return pattern, name


def _read_start(text: str) -> tuple[float, float, float]:
    import math

    pose = read_pose(text, "--start")
    return pose.x, pose.y, math.degrees(pose.yaw)
