"""Colours that one picture shows differ, also for the colour-blind."""

import ast
import itertools
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import is_color_like, to_rgb, to_rgba

import radarsim
from radarsim.geometry import Floats
from radarsim.plotting.palette import (
    FAMILY_COLOURS,
    FOLLOWING,
    GOING,
    INK,
    LASER,
    LASERS,
    LEFT_RAY,
    NOT_SENSED,
    PAGE_COLOURS,
    PAPER,
    RADAR,
    RADARS,
    RETURNED,
    RETURNING,
    RIGHT_RAY,
    ROBOTS,
    TARGET,
    TRUTH,
    Family,
    family_of,
    paler,
    sensor_colour,
)
from radarsim.plotting.style import area_style
from radarsim.scene.material import Material

# Machado, Oliveira and Fernandes 2009, severity 1, for linear RGB.
SIGHTS = {
    "normal": np.eye(3),
    "protanopia": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "deuteranopia": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
}
XYZ_OF_RGB = np.array(  # sRGB, D65
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)

_ON_MATERIALS = (PAPER, INK, *FAMILY_COLOURS.values())
_OUTLINES = (Family.STONE, Family.FOLIAGE, Family.SMOKE)  # of runs
_RUN = (
    PAPER,
    INK,
    TRUTH,
    GOING,
    FOLLOWING,
    RETURNING,
    TARGET,
    *(FAMILY_COLOURS[family] for family in _OUTLINES),
)
_CELLS = (
    NOT_SENSED,
    PAPER,
    INK,
    *(FAMILY_COLOURS[family] for family in (Family.FOLIAGE, Family.SMOKE)),
)
_PAGE_MARKS = ("radar", "laser", "true", "path", "hit", "goal")
SHOWN_TOGETHER = {
    "left and right rays": (*_ON_MATERIALS, LEFT_RAY, RIGHT_RAY),
    "beam and what comes back": (*_ON_MATERIALS, RADAR, RETURNED),
    "sensors over a plan": (*_ON_MATERIALS, RADAR, LASER),
    "radars and lasers": (PAPER, INK, *RADARS, *LASERS),
    **{f"run with {sensor}": (*_RUN, sensor) for sensor in (RADAR, LASER)},
    "map": (*_CELLS, GOING, TRUTH),
    **{
        f"robots on the page, {scheme}": (
            *ROBOTS,
            *(PAGE_COLOURS[name][dark] for name in ("paper", "radar", "laser")),
        )
        for dark, scheme in enumerate(("light", "dark"))
    },
    **{
        f"map on the page, {scheme}": (
            *_CELLS,
            *(PAGE_COLOURS[name][dark] for name in _PAGE_MARKS),
        )
        for dark, scheme in enumerate(("light", "dark"))
    },
}


def lab(colour: str, sight: Floats) -> Floats:
    """Return L*, a* and b* of a colour as somebody with that sight sees it."""
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    xyz = XYZ_OF_RGB @ np.clip(sight @ linear, 0, 1) / XYZ_OF_RGB.sum(axis=1)
    x, y, z = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def test_known_colours_have_known_lab_values() -> None:
    assert lab("white", SIGHTS["normal"]) == pytest.approx([100, 0, 0], abs=0.01)
    assert lab("red", SIGHTS["normal"]) == pytest.approx([53.24, 80.09, 67.2], abs=0.05)


@pytest.mark.parametrize("sight", SIGHTS)
@pytest.mark.parametrize("picture", SHOWN_TOGETHER)
def test_colours_of_a_picture_differ(picture: str, sight: str) -> None:
    for one, other in itertools.combinations(SHOWN_TOGETHER[picture], 2):
        difference = lab(one, SIGHTS[sight]) - lab(other, SIGHTS[sight])
        assert np.linalg.norm(difference) > 20, (one, other)


@pytest.mark.parametrize(
    ("material", "family"),
    [
        (Material("foliage", density=0.7), Family.FOLIAGE),
        (Material("shrub_cloud", density=1.59), Family.FOLIAGE),
        (Material("tree_leaves", sheet_loss=0.2), Family.FOLIAGE),
        (Material("Dust cloud", density=0.0, solid=False), Family.SMOKE),
        (Material("painted_steel"), Family.METAL),
        (Material("wood_floor"), Family.GROUND),
        (Material("crate"), Family.WOOD),
        (Material("x", density=1.0), Family.FOLIAGE),
        (Material("x", density=0.0, solid=False), Family.SMOKE),
        (Material("x", laser_mirror=True), Family.METAL),
        (Material("x"), Family.STONE),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_family_follows_from_name_and_properties(
    material: Material, family: Family
) -> None:
    assert family_of(material) == family


@pytest.mark.parametrize("sight", SIGHTS)
@pytest.mark.parametrize("family", Family)
@pytest.mark.parametrize("medium", ["radar", "laser"])
def test_readings_differ_from_pale_objects(
    medium: str, family: Family, sight: str
) -> None:
    reading, pale = sensor_colour(medium), paler(FAMILY_COLOURS[family])
    difference = lab(reading, SIGHTS[sight]) - lab(pale, SIGHTS[sight])
    assert np.linalg.norm(difference) > 20


@pytest.mark.parametrize("family", Family)
def test_areas_look_on_paper_like_the_colour_of_their_family(family: Family) -> None:
    *paint, opacity = to_rgba(area_style(family)["facecolor"])
    on_paper = [opacity * part + 1 - opacity for part in paint]
    assert on_paper == pytest.approx(to_rgb(FAMILY_COLOURS[family]))
    assert (opacity < 1) == (family is Family.SMOKE)


PACKAGE = Path(radarsim.__file__).parent
# The table, the sky that cameras see, and the style sheets of pages of text.
OTHERS = ("plotting/palette.py", "server/camera.py")
HEX = re.compile(r"#[0-9a-fA-F]{6}\b")
SHADES = re.compile(r"0?\.\d+|none|white|inherit")  # of grey


def colours_of_its_own(source: str) -> Iterator[str]:
    """Yield the colours that a module has besides the table, greys excepted."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from HEX.findall(node.value)
        elif isinstance(node, ast.keyword) and "color" in str(node.arg):
            named = node.value
            if (
                isinstance(named, ast.Constant)
                and is_color_like(named.value)
                and not SHADES.fullmatch(str(named.value))
            ):
                yield str(named.value)


def test_a_colour_beside_the_table_is_found() -> None:
    source = 'plot(color="#123456"); plot(color="0.5"); plot(facecolor="tab:blue")'
    assert set(colours_of_its_own(source)) == {"#123456", "tab:blue"}


def test_all_plots_take_their_colours_from_the_table() -> None:
    found = {
        name: own
        for path in sorted(PACKAGE.rglob("*.py"))
        if (name := path.relative_to(PACKAGE).as_posix()) not in OTHERS
        and (own := [*colours_of_its_own(path.read_text(encoding="utf-8"))])
    }
    assert found == {}


def test_scripts_of_the_page_have_no_colours_of_their_own() -> None:
    scripts = sorted((PACKAGE / "addons/web/page").glob("*.js"))
    lines = [
        f"{path.name}: {line.strip()}"
        for path in scripts
        if path.name != "three.bundle.js"
        for line in path.read_text(encoding="utf-8").splitlines()
        if HEX.search(line) and "Light(" not in line  # of a lamp
    ]
    assert len(scripts) > 10
    assert lines == []
