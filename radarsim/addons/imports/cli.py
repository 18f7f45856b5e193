"""``radarsim import``: import a map or a robot class from a file of another program."""

from __future__ import annotations

import shutil
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Annotated, Final, Literal, TypeAlias

import click
from annotated_types import Gt, Unit

from radarsim.autonomy.plans import MapPose
from radarsim.cli.output import check_new_map, print_lines, print_message, write_file
from radarsim.errors import describe_os_error, expected_one_of
from radarsim.plans import RARE, Form, Option
from radarsim.processes import raise_on_signals

if TYPE_CHECKING:
    from radarsim.addons.imports.imported_map import ImportedMap

Kind: TypeAlias = Literal["map_server", "sdf", "gltf", "ini"]

_ENDINGS: Final[dict[Kind, tuple[str, ...]]] = {
    "map_server": (".yaml", ".yml"),
    "sdf": (".sdf", ".world"),
    "gltf": (".glb", ".gltf"),
    "ini": (".ini",),
}


def _read_pattern(text: str) -> tuple[str, str]:
    pattern, sign, name = text.partition("=")
    if not (pattern and sign and name):
        raise ValueError(f"{text!r}, expected PATTERN=NAME")
    return pattern, name


_Material = Annotated[tuple[str, str], Form("PATTERN=NAME", _read_pattern)]


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportOptions:
    """Options of an import: information that the imported file lacks.

    Attributes:
        start: Start pose, map frame; by default in the widest free area of a map_server
            plan, else at the origin.
        material: Material of objects whose names match, as '*hedge*=hedge'; repeat the
            option for others, the first match counts.
        default_material: Material of all other objects.
        wall_height: Height of the walls of a map_server plan.
        model_path: Folder with models, meshes or images that FILE refers to; repeat the
            option for several.
        visuals: Import the visuals of SDF models, which Gazebo's GPU lidars see, rather
            than their collisions.
    """

    start: MapPose | None = None
    material: Annotated[tuple[_Material, ...], RARE] = ()
    default_material: Annotated[str, RARE] = "concrete"
    wall_height: Annotated[float, Gt(0), Unit("m"), RARE] = 2.0
    model_path: Annotated[tuple[Path, ...], Option(metavar="DIR", is_rare=True)] = ()
    visuals: bool = False


def import_(
    file: Annotated[Path, Option(is_argument=True)],
    *,
    output: Annotated[Path, Option(names=("-o", "--output"))],
    kind: Annotated[Kind | None, Option(names=("--from",))] = None,
    robot: Annotated[str | None, Option(metavar="CLASS")] = None,
    options: ImportOptions,
    strict: Annotated[bool, RARE] = False,
) -> int:
    """Make a map or a robot class from a file of another program.

    Args:
        file: File to import.
        output: Map file, or file of a robot class, to write.
        kind: Format of FILE; by default that of its file ending.
        robot: Robot class to import if FILE has several.
        options: Information that the file lacks.
        strict: Write nothing, and exit with 1, if a part of FILE must be left out.

    Returns:
        The exit code.
    """
    check_new_map(output, "-o")
    kind = kind or _kind_of(file)
    if kind == "ini":
        import yaml

        from radarsim.addons.imports.usarsim_ini import import_ini
        from radarsim.simulation.config import SimulationConfig

        model, notes = import_ini(file, robot)
        # This check is the same as when a server loads the file of the robot class.
        SimulationConfig(robots=(model,)).check()
        content = model.model_dump(mode="json", exclude_defaults=True)
        text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None)
        if notes:
            print_lines(notes)
        if not (notes and strict):
            write_file(output, text.encode(), "-o")
            print_message(f"wrote {output}")
        return int(bool(notes and strict))
    folder = output.with_name(f"{output.stem}_meshes")
    read = resolve_name(f"radarsim.addons.imports.{kind}:import_{kind}")
    imported: ImportedMap = read(file, options, folder)
    _check_materials(options, imported)
    if imported.notes:
        print_lines(imported.notes)
    is_refused = bool(imported.notes and strict)
    if not is_refused:
        _write_map(imported, output, folder)
        for warning in imported.warnings():
            print_message(warning)
        plural = "s" * (imported.count != 1)
        print_message(f"wrote {output}: {imported.count} object{plural}")
    if imported.models:
        print_message(imported.summary())
    return int(is_refused or imported.is_mostly_left_out)


def _write_map(imported: ImportedMap, output: Path, folder: Path) -> None:
    """Write a map file and a new folder with its meshes; write nothing on an error."""
    with raise_on_signals(), ExitStack() as undo:
        try:
            if imported.meshes:
                folder.mkdir()
                undo.callback(shutil.rmtree, folder)
            for name, content in imported.meshes.items():
                (folder / name).write_bytes(content)
        except OSError as error:
            text = f"cannot write {folder}: {describe_os_error(error)}"
            raise click.BadParameter(text, param_hint="-o") from None
        # The meshes are written first, because ``to_text`` loads them to check the map.
        write_file(output, imported.to_text(output).encode(), "-o")
        undo.pop_all()


def _check_materials(options: ImportOptions, imported: ImportedMap) -> None:
    """Check that all materials named by options are in the library or in the file."""
    from radarsim.scene.material import library_names

    known = [*library_names(), *imported.materials]
    named = {"--default-material": [options.default_material]}
    named["--material"] = [name for _, name in options.material]
    for hint, names in named.items():
        for name in names:
            if name not in known:
                text = f"material {expected_one_of(name, known)}"
                raise click.BadParameter(text, param_hint=hint)


def _kind_of(file: Path) -> Kind:
    for kind, endings in _ENDINGS.items():
        if file.suffix.lower() in endings:
            return kind
    text = f"{str(file)!r}, expected a known file ending, or --from"
    raise click.BadParameter(text, param_hint="FILE")
