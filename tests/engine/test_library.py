"""Calls into the engine are checked against the descriptions in C++."""

import copy
import math
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim.addons.fmcw import scattering, speckle
from radarsim.autonomy.mapping.occupancy_grid import NEAR, SENSED
from radarsim.autonomy.mapping.scan import _ECHO_KINDS, BeamEnd, Layer
from radarsim.autonomy.navigation import footprint_planning
from radarsim.engine import build, engine, library
from radarsim.engine.library import Engine
from radarsim.errors import EngineError
from radarsim.protocol import line_template
from radarsim.raycast import embree, traced_scene
from radarsim.raycast.rays import EventKind, Outcome
from radarsim.sensors import echo_extraction
from radarsim.sensors.echo_extraction import _MODES


def vectors(count: int = 2) -> Any:
    return np.zeros((count, 3))


def read_only() -> Any:
    found = vectors()
    found.flags.writeable = False
    return found


def turn(turned: Any, *, which: int = 0) -> None:
    """Turn the axes x and y by a quarter about z."""
    axes, quarter = np.eye(3)[:2], np.array([[[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]])
    engine.turn_directions(axes, quarter, np.full(2, which), turned)


def test_function_reads_and_writes_arrays() -> None:
    turned = vectors()
    turn(turned)
    assert turned.tolist() == [[0, 1, 0], [-1, 0, 0]]


@pytest.mark.parametrize(
    ("turned", "text"),
    [
        pytest.param(vectors(3), "an array float64[3, 3]", id="too long"),
        pytest.param(np.zeros((2, 3), "f4"), "an array float32[2, 3]", id="a type"),
        pytest.param(np.zeros((2, 3), ">f8"), "an array >f8[2, 3]", id="byte order"),
        pytest.param(
            vectors(4)[::2], "an array float64[2, 3], not contiguous", id="gaps"
        ),
        pytest.param(np.zeros(6), "an array float64[6]", id="an axis less"),
        pytest.param(read_only(), "an array float64[2, 3], read-only", id="read-only"),
        pytest.param([0, 0], "[0, 0]", id="a list"),
    ],
)
def test_unexpected_arrays_are_rejected(turned: Any, text: str) -> None:
    with pytest.raises(EngineError) as caught:
        turn(turned)
    assert str(caught.value) == (
        f"argument 4 of turn_directions is {text},"
        " expected an array f8[n,3] to write to where n = 2"
    )


def test_array_that_is_not_aligned_is_rejected() -> None:
    turned = np.zeros(49, np.uint8)[1:].view(np.float64).reshape(2, 3)
    with pytest.raises(EngineError, match=r"^argument 4 of turn_directions is an arr"):
        turn(turned)


def test_arrays_of_other_classes_and_equal_types_are_accepted() -> None:
    turned = vectors()
    turn(turned.view(np.recarray))
    link = np.zeros(1, np.dtype(engine.rows["Link"].descr))
    assert engine.angle_of_link(link, 3.0) == 0.0
    assert turned.any()


def test_missing_memory_is_an_error() -> None:
    for _ in range(3):
        cells, distances = np.zeros((0, 2**50), np.bool_), np.zeros((0, 2**50))
        with pytest.raises(MemoryError, match="little memory for fill_distances"):
            engine.fill_distances(cells, 1.0, distances)


def test_arrays_that_are_only_read_may_be_read_only() -> None:
    inputs, turned = (np.eye(3), np.eye(3)[None], np.zeros(3, np.int64)), vectors(3)
    for each in inputs:
        each.flags.writeable = False
    engine.turn_directions(*inputs, turned)
    assert (turned == np.eye(3)).all()


def test_number_of_arguments_is_checked() -> None:
    with pytest.raises(TypeError, match=r"^1 arguments for turn_directions"):
        engine.turn_directions(vectors())


def test_unknown_function_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="the engine has no function 'nothing'"):
        engine.nothing()


def node_table(**changes: Any) -> library.Packed:
    fields = {
        "directions": np.zeros((2, 3, 3)),
        "starts": np.zeros((1, 3, 3)),
        "edges": np.full(1, 0.5),
        "sides": np.zeros(2, np.int8),
    }
    return engine.structures["NodeTable"].pack(**fields | changes)


def test_fields_of_packed_structures_are_their_attributes() -> None:
    edges = np.full(1, 0.25)
    table = node_table(edges=edges)
    assert table.edges is edges
    with pytest.raises(AttributeError, match="NodeTable has no 'nodes'"):
        assert table.nodes


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        pytest.param(
            {"starts": np.zeros((1, 4, 3))},
            "NodeTable.starts is an array float64[1, 4, 3],"
            " expected an array f8[s,n,3] where n = 3",
            id="lengths",
        ),
        pytest.param(
            {"nodes": 1}, "NodeTable: fields ['nodes'] are missing or unknown", id="odd"
        ),
    ],
)
def test_unexpected_fields_are_rejected(changes: dict[str, Any], text: str) -> None:
    with pytest.raises(EngineError) as caught:
        node_table(**changes)
    assert str(caught.value) == text


def test_numbers_and_references_are_checked() -> None:
    fields = {
        "origins": np.zeros((0, 3)),
        "directions": np.zeros((0, 3)),
        "max_range": np.ones(1),
        "power": np.ones(1),
        "class_index": np.zeros(1, np.uint8),
        "carrier": np.zeros(1, np.int64),
        "table": node_table(),
        "radius": 0.0,
    }
    pack = engine.structures["RaySource"].pack
    pack(**fields)
    with pytest.raises(EngineError, match=r"^RaySource.radius is 'wide', expected a n"):
        pack(**fields | {"radius": "wide"})
    with pytest.raises(EngineError, match=r"^RaySource.radius is '3', expected a n"):
        pack(**fields | {"radius": "3"})
    with pytest.raises(EngineError, match=r"^RaySource.table is None, expected a pack"):
        pack(**fields | {"table": None})
    with pytest.raises(EngineError, match=r"^RaySource.table is a packed Ray"):
        pack(**fields | {"table": pack(**fields)})


def test_packed_structure_is_not_copied() -> None:
    with pytest.raises(TypeError, match=r"^cannot copy a packed NodeTable"):
        copy.copy(node_table())


def test_lengths_that_do_not_belong_together_are_rejected() -> None:
    with pytest.raises(EngineError, match=r"^turn_directions .*inconsistent lengths"):
        turn(vectors(), which=1)


@pytest.mark.parametrize("number", [2**63, -(2**63) - 1, 1e300, math.inf, math.nan])
def test_numbers_without_room_are_rejected(number: float) -> None:
    masks, steps = np.zeros((2, 2), np.int64), np.zeros((16, 2), np.int64)
    with pytest.raises(EngineError, match=r"^argument 3 of are_joined is .*, expected"):
        engine.are_joined(masks, steps, number, 0)


def test_search_ends_where_steps_cost_less_than_nothing() -> None:
    cost, targets = np.full((3, 3), -1e-3), np.zeros((3, 3), np.bool_)
    parents, best = np.zeros((3, 3), np.int64), np.full((3, 3), math.inf)
    assert engine.search_grid(cost, 0, 0, targets, parents, best) == -1


def test_entries_of_walls_that_are_missing_are_not_read() -> None:
    kinds = engine.rows
    floors = np.zeros(1, kinds["WallGrid"])
    floors["cell"] = floors["columns"] = floors["rows"] = 1
    floors["end"] = 1000
    lines = np.zeros(1, engine.rows["LineSegment"])
    marks, searches = np.zeros((2, 1), np.int64)
    walls = engine.structures["Walls"].pack(
        lines=lines,
        entries=np.zeros(0, kinds["WallEntry"]),
        floors=floors,
        marks=marks,
        searches=searches,
    )
    assert engine.find_walls(walls, 0.0, 0.5, 0.5, 1.0, lines.copy()) == 0


def test_structure_of_numbers_is_a_row_of_an_array() -> None:
    event = engine.rows["Event"]
    assert event.names is not None
    assert event.names[:4] == ("ray", "t", "part", "kind")
    assert event.itemsize == 64


HEADERS = "".join(path.read_text() for path in build.FOLDER.glob("*.hpp"))


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("Kind", {kind.name: kind for kind in EventKind}),
        ("Outcome", Outcome.__members__),
        ("Role", {"COLLECT": traced_scene.COLLECT, "OPAQUE": traced_scene.OPAQUE}),
        ("BeamEnd", BeamEnd.__members__),
        ("Layer", {f"{layer.name}_LAYER": layer for layer in Layer}),
        ("EchoKind", {kind.upper(): i for kind, i in _ECHO_KINDS.items()}),
        ("Mode", {k.upper(): i for k, i in _MODES.items() if k != "all"}),
        ("CellFlag", {"SENSED": SENSED, "NEAR": NEAR}),
    ],
)
def test_enumerations_are_those_of_python(name: str, expected: dict[str, int]) -> None:
    found = re.search(rf"enum (?:class )?{name} [^{{]*{{([^}}]*)}}", HEADERS)
    assert found
    values, last = {}, -1
    for member in re.split(r",\s*", found[1].strip()):
        key, _, value = member.partition(" = ")
        values[key] = last = int(value or last + 1)
    assert values.items() >= expected.items()


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("HEADINGS", len(footprint_planning._HEADINGS)),
        ("HASH_LEVELS", speckle._LEVELS),
        ("LONGEST_NUMBER", line_template._LONGEST_NUMBER),
        ("TOO_LARGE", line_template._TOO_LARGE),
        ("TINY", embree.TINY),
        ("GRAZING", scattering.GRAZING),
        ("RELIEF_STEP", speckle.TEXTURE_CELL),
        ("NEPER_DB", scattering.NEPER_DB),
        ("NOTHING_LEFT", echo_extraction.NOTHING_LEFT),
        ("LEAF_BACKSCATTER", echo_extraction.LEAF_BACKSCATTER),
    ],
)
def test_constants_are_those_of_python(name: str, expected: float) -> None:
    found = re.search(rf"\b{name} = ([-\d.e/ ]+)[;,]", HEADERS)
    assert found
    numerator, _, denominator = found[1].partition(" / ")
    assert float(numerator) / float(denominator or 1) == expected


def test_missing_library_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "libradarsim.so"
    with pytest.raises(EngineError) as caught:
        Engine(path)
    text = str(caught.value)
    assert text.startswith(f"cannot use {path}: {path}: cannot open shared object file")
    assert text.endswith("; it is compiled when radarsim is installed")


def test_library_of_another_source_is_reported(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(library, "source_digest", lambda: "0123456789abcdef")
    if not (build.FOLDER / "engine.cpp").exists():
        pytest.skip("the package is installed without the sources of its engine")
    with pytest.raises(EngineError) as caught:
        Engine(build.LIBRARY)
    assert str(caught.value) == (
        f"{build.LIBRARY} was built from other sources; compile it again by"
        " 'pip install -e .', or by 'python radarsim/engine/build.py'"
        " where ziglang is installed"
    )


def test_compiler_that_fails_is_reported(tmp_path: Path) -> None:
    target = tmp_path / "engine.so"
    with pytest.raises(
        SystemExit, match=r"ended with 1; the compiler is that of the package zig"
    ):
        build.compile_engine(target, sys.executable, "-c", "raise SystemExit(1)")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("system", "machine"), [("win32", "AMD64"), ("linux", "aarch64")]
)
def test_other_platforms_are_refused(
    monkeypatch: pytest.MonkeyPatch, system: str, machine: str
) -> None:
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr("platform.machine", lambda: machine)
    with pytest.raises(SystemExit) as caught:
        build.compile_engine()
    assert str(caught.value) == (
        "radarsim runs on Linux on x86-64, for which embreex and this package are"
        f" tested, not on {system} on {machine}"
    )


def test_engine_needs_no_newer_c_library_than_its_wheel_says() -> None:
    found = re.findall(rb"GLIBC_2\.(\d+)", build.LIBRARY.read_bytes())
    assert found
    assert max(map(int, found)) <= 17
    listed = subprocess.run(["ldd", build.LIBRARY], capture_output=True, check=True)
    assert b"stdc++" not in listed.stdout
