"""COLLADA files are read as they are meant, and errors in them are reported."""

import io
import zipfile
from itertools import pairwise

import numpy as np
import pytest
from collada_files import box_file, box_geometry, two_boxes_file

from radarsim.addons.imports import collada
from radarsim.addons.imports.collada import read_collada
from radarsim.geometry import Floats
from radarsim.scene.mesh_files import MeshError

GOOD = box_file((2, 3, 4), "polylist")
LIST = "<vcount>4 4 4 4 4 4 </vcount>"
LIBRARY = "<library_nodes></library_nodes>"
DEEP = 20_000 * "<node>" + 20_000 * "</node>"
NAMES = [f"n{i}" for i in range(60)]
# A node of two nodes of two nodes, and so on.
USE = '<instance_node url="#{}"/>'
DOUBLED = "".join(
    f'<node id="{name}">{2 * USE.format(of)}</node>' for of, name in pairwise(NAMES)
)
BOMB = two_boxes_file((1, 1, 1), 4).replace("#box", "#n59")
DOCTYPES = {
    "entity": '<!DOCTYPE C [<!ENTITY a "1"><!ENTITY b "&a;&a;">]>',
    "file": '<!DOCTYPE C [<!ENTITY a SYSTEM "file:///etc/passwd">]>',
    "outside": '<!DOCTYPE C SYSTEM "http://127.0.0.1:1/c.dtd">',
}
WRONG = {
    "other XML": "<sdf/>",
    "cut off": GOOD[:2000],
    "deep": GOOD.replace(LIBRARY, LIBRARY.replace("><", f">{DEEP}<")),
    "no scene": GOOD.replace("#scene", "#other"),
    "no triangles": GOOD.replace("#g", "#other"),
    "unit of 0": GOOD.replace('meter="1.0"', 'meter="0"'),
    "unit of words": GOOD.replace('meter="1.0"', 'meter="an inch"'),
    "infinite": GOOD.replace("-1.0 -1.5", "1e999 -1.5"),
    "word": GOOD.replace("-1.0 -1.5", "far -1.5"),
    "negative": GOOD.replace("<p>0 0", "<p>-1 0"),
    "too high": GOOD.replace("<p>0 0", "<p>8 0"),
    "more corners": GOOD.replace(LIST, "<vcount>2000000000 4 4 4 4 4</vcount>"),
    "fewer corners": GOOD.replace(LIST, "<vcount>-4 12 4 4 4 4</vcount>"),
    "doubled": BOMB.replace('<node id="box"', DOUBLED + '<node id="n0"'),
    "includes itself": BOMB.replace('id="box">', f'id="n59">{USE.format("n59")}'),
}
WRONG |= {n: GOOD.replace("<COLLADA", f"{DOCTYPES[n]}<COLLADA") for n in DOCTYPES}
SLOW = pytest.mark.slow


def bounds(text: str) -> Floats:
    meshes, problems = read_collada(text.encode())
    assert problems == []
    vertices = np.concatenate([vertices for _, (vertices, _) in meshes])
    return np.array([vertices.min(0), vertices.max(0)])


def test_upward_axis_does_not_count() -> None:
    expected = bounds(box_file((2, 3, 4)))
    np.testing.assert_array_equal(bounds(box_file((2, 3, 4), up_axis="Y_UP")), expected)


def test_mirrored_node_stays_outward() -> None:
    text = box_file((2, 3, 4)).replace("<scale>1 1 1<", "<scale>-1 1 1<")
    ((_, (vertices, faces)),), _ = read_collada(text.encode())
    corners = vertices[faces]
    assert np.linalg.det(corners).sum() / 6 == pytest.approx(24)


def test_nodes_of_a_library_have_the_names_of_their_places() -> None:
    meshes, _ = read_collada(two_boxes_file((1, 1, 1), 4).encode())
    middles = {name: vertices.mean(0).tolist() for name, (vertices, _) in meshes}
    assert middles == {"left": [-2, 0, 0], "right": [2, 0, 0]}


@pytest.mark.parametrize(
    "wrong", [('source="#g-n"', 'source="#none"'), (">0 0 1<", "><"), ("NORMAL", "UV")]
)
def test_normals_do_not_matter(wrong: tuple[str, str]) -> None:
    text = box_file((2, 3, 4), "polylist")
    assert wrong[0] in text
    np.testing.assert_array_equal(bounds(text.replace(*wrong)), bounds(text))


def test_cameras_and_lights_are_not_missed() -> None:
    text = box_file((2, 3, 4))
    seen = '<node><instance_camera url="#c"/></node><node><instance_light url="#l"/>'
    np.testing.assert_array_equal(
        bounds(text.replace("<node id", f"{seen}</node><node id")), bounds(text)
    )


def test_parts_that_cannot_be_read_are_reported_and_others_are_read() -> None:
    broken = box_geometry("h", (1, 1, 1)).replace("<param", "<other")
    text = box_file((2, 3, 4)).replace("</library_geo", f"{broken}</library_geo")
    meshes, problems = read_collada(text.encode())
    assert len(meshes) == len(problems) == 1


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[SLOW] * (n == "doubled")) for n in WRONG]
)
def test_wrong_file_is_reported(name: str) -> None:
    with pytest.raises(MeshError) as caught:
        read_collada(WRONG[name].encode())
    assert "\n" not in str(caught.value)
    assert ("DOCTYPE" in str(caught.value)) == (name in DOCTYPES)


def test_number_of_elements_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(collada, "MAX_ELEMENTS", 1000)  # 2 million take seconds
    assert read_collada(GOOD.encode())[0]
    with pytest.raises(MeshError, match="1001 elements, expected at most 1000"):
        read_collada(GOOD.replace(LIBRARY, 1000 * "<a/>").encode())


@pytest.mark.parametrize("encoding", ["utf-16", "cp037", "utf-7"])
def test_document_type_is_refused_in_any_encoding(encoding: str) -> None:
    text = WRONG["file"].replace('encoding="utf-8"', f'encoding="{encoding}"')
    with pytest.raises(MeshError):
        read_collada(text.encode(encoding))


def test_archive_is_not_opened() -> None:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("box.dae", GOOD)
    with pytest.raises(MeshError):
        read_collada(packed.getvalue())


def test_no_file_is_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    read_collada(GOOD.encode())  # its modules are imported then

    def refuse(*args: object, **_: object) -> None:
        raise AssertionError(args)

    monkeypatch.setattr("builtins.open", refuse)
    monkeypatch.setattr("io.open", refuse)
    assert "file:///etc/passwd" in GOOD
    assert read_collada(GOOD.encode())[0]
