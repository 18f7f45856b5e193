"""glTF and SDF files that are changed at random, in their bytes and their structure."""

import base64
import json
import random
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

import numpy as np

from radarsim.addons.imports.cli import ImportOptions
from radarsim.addons.imports.gltf import import_gltf
from radarsim.addons.imports.sdf import import_sdf
from radarsim.errors import ForeignFileError
from radarsim.scene.shapes import box

CORNERS, FACES = box(1, 1, 1)
_BUFFER: Final = b"".join(
    [
        np.round(CORNERS * 254).astype("i1").tobytes(),  # 24 bytes
        FACES.astype("<u2").tobytes(),  # 72 bytes
        CORNERS.astype("<f4").tobytes(),  # 96 bytes
        np.array([0, 1, 3, 2, 6, 4, 5, 1], "<u2").tobytes(),
    ]
)
GLTF: Final[dict[str, Any]] = {
    "asset": {"version": "2.0"},
    "extensionsRequired": ["KHR_mesh_quantization"],
    "scene": 0,
    "scenes": [{"nodes": [0]}],
    "nodes": [
        {"children": [1, 2], "translation": [1, 2, 3]},
        {"mesh": 0, "scale": [2, 2, 2], "rotation": [0, 0, 0.6, 0.8]},
        {"mesh": 1, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1]},
    ],
    "meshes": [
        {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]},
        {
            "primitives": [
                {"attributes": {"POSITION": 2}, "indices": 3, "mode": mode}
                for mode in (5, 6)
            ]
        },
    ],
    "materials": [{"name": "leaves", "extras": {"density": 0.5}}],
    "accessors": [
        {
            "bufferView": 0,
            "componentType": 5120,
            "count": 8,
            "type": "VEC3",
            "normalized": True,
        },
        {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
        {"bufferView": 2, "componentType": 5126, "count": 8, "type": "VEC3"},
        {"bufferView": 3, "componentType": 5123, "count": 8, "type": "SCALAR"},
    ],
    "bufferViews": [
        {"buffer": 0, "byteOffset": start, "byteLength": size}
        for start, size in ((0, 24), (24, 72), (96, 96), (192, 16))
    ],
    "buffers": [
        {
            "byteLength": len(_BUFFER),
            "uri": "data:;base64," + base64.b64encode(_BUFFER).decode(),
        }
    ],
}
_SHAPES: Final = (
    "<box><size>1 2 3</size></box>",
    "<sphere><radius>1</radius></sphere>",
    "<cylinder><radius>0.5</radius><length>2</length></cylinder>",
    "<capsule><radius>0.5</radius><length>2</length></capsule>",
    "<cone><radius>0.5</radius><length>2</length></cone>",
    "<ellipsoid><radii>1 2 3</radii></ellipsoid>",
    "<polyline><point>0 0</point><point>4 0</point><point>0 4</point>"
    "<height>1</height></polyline><polyline><point>1 1</point><point>2 1</point>"
    "<point>1 2</point><height>1</height></polyline>",
    "<mesh><uri>model://part/part.gltf</uri><scale>1 2 1</scale></mesh>",
    "<plane/>",
)
_LINK: Final = "".join(
    f'<collision name="c{number}"><pose>{number} 0 0 0 0.1 0</pose>'
    f"<geometry>{shape}</geometry></collision>"
    for number, shape in enumerate(_SHAPES)
)
MODEL: Final = f"""<sdf version="1.9"><model name="part" placement_frame="hook">
<frame name="hook" attached_to="l"><pose>0 0 1 0 0 0</pose></frame>
<link name="l"><pose relative_to="up">1 0 0 0 0 0</pose>{_LINK}</link>
<frame name="up"><pose degrees="true">0 0 1 0 90 0</pose></frame>
<joint name="j"><parent>world</parent><child>l</child></joint></model></sdf>"""
WORLD: Final = f"""<?xml version="1.0"?><sdf version="1.9"><world name="w">
<include><uri>model://part</uri><name>a</name><pose>1 1 0 0 0 0</pose></include>
<include><uri>model://part</uri><name>b</name><pose relative_to="a::up"/>
<placement_frame>up</placement_frame></include>
<model name="m"><static>1</static><pose rotation_format="quat_xyzw">0 0 0 0 0 0 1</pose>
<link name="l">{_LINK}</link><model name="n"><link name="k"/></model></model><light/>
<state><model name="m"><pose>5 2 1 0 0 0.5</pose><scale>1 4 2</scale><link name="l">
<pose>5 2 1 0 0 0.5</pose></link></model></state></world></sdf>"""
CONFIG: Final = (
    '<model><sdf version="1.4">old.sdf</sdf><sdf version="1.9">part.sdf</sdf></model>'
)
_HOSTILE: Final[tuple[object, ...]] = (
    *(-1, 0, 1, 2, 7, 255, 2**31, 2**63, 10**30, 0.5, 1e-30, 1e30, 1e308),
    *(None, True, [], {}, "", "a", "..", "\0", "é", [[]] * 3, "SCALAR", 5125),
)
_WORDS: Final = (
    *("", "0", "-1", "1e308", "nan", "1 2", "1 2 3", "0 0 0 0 0 0", "a", "l", "up"),
    *(
        "part",
        "model://part",
        "model://m",
        "file://",
        "https://x/y/models/part/1",
        "::",
    ),
    *("a::up", "1 " * 20, "1e-300", "1e30 1 1", "true", "__model__", "hook", "world"),
)


def outcomes(folder: Path, seeds: Iterable[int]) -> Counter[str]:
    """Import one changed file for each seed; return how many became what.

    Anything but a map or an error of the package is raised.
    """
    part = folder / "models" / "part"
    part.mkdir(parents=True)
    (part / "part.gltf").write_text(json.dumps(GLTF))
    counts: Counter[str] = Counter()
    for seed in seeds:
        rng = random.Random(seed)
        name, kinds = rng.choice([("gltf", 2), ("sdf", 3)])
        texts = {"model.config": CONFIG, "part.sdf": MODEL, "w.sdf": WORLD}
        texts["w.gltf"] = json.dumps(GLTF)
        target = "w.gltf" if name == "gltf" else [*texts][rng.randrange(kinds)]
        content = _changed(rng, target, texts[target])
        for each, text in texts.items():
            place = folder if each.startswith("w.") else part
            (place / each).write_bytes(content if each == target else text.encode())
        counts[f"{name}: {_import(folder, folder / f'w.{name}')}"] += 1
    return counts


def _import(folder: Path, path: Path) -> str:
    options = ImportOptions(model_path=(folder / "models",))
    try:
        if path.suffix == ".gltf":
            imported = import_gltf(path, options, folder)
        else:
            imported = import_sdf(path, options, "meshes")
            (folder / "meshes").mkdir(exist_ok=True)
            for name, content in imported.meshes.items():
                (folder / "meshes" / name).write_bytes(content)
        imported.to_text(folder / "map.yaml")
    except ForeignFileError:
        return "refused"
    return "a map"


def _changed(rng: random.Random, name: str, text: str) -> bytes:
    """Return a text with a few changes of its structure, its bytes, or both."""
    change: Callable[[random.Random, str], str] = (
        _change_json if name.endswith("gltf") else _change_xml
    )
    if rng.random() < 0.7:
        for _ in range(rng.randint(1, 3)):
            text = change(rng, text)
    content = bytearray(text.encode(errors="replace"))
    for _ in range(rng.choice([0, 0, 1, 3])):
        at, size = rng.randrange(len(content) + 1), rng.randrange(1, 20)
        match rng.randrange(4):
            case 0:
                content[at : at + size] = b""
            case 1:
                content[at:at] = rng.randbytes(size)
            case 2:
                content[at : at + 1] = bytes([rng.randrange(256)])
            case _:
                content[at:at] = content[at : at + size] * rng.choice([1, 2, 1000])
    return bytes(content)


def _change_json(rng: random.Random, text: str) -> str:
    tree = json.loads(text)
    places: list[tuple[Any, Any]] = []
    left = [tree]
    while left:
        item = left.pop()
        keys = [*item] if isinstance(item, dict) else range(len(item))
        places += [(item, key) for key in keys]
        left += [item[key] for key in keys if isinstance(item[key], dict | list)]
    if not places:
        return text
    item, key = rng.choice(places)
    other, other_key = rng.choice(places)
    match rng.randrange(4):
        case 0:
            del item[key]
        case 1:
            item[key] = json.loads(json.dumps(other[other_key]))
        case 2 if isinstance(item, list):
            item += [item[key]] * rng.choice([1, 5, 3000])
        case _:
            item[key] = rng.choice(_HOSTILE)
    return json.dumps(tree)


def _change_xml(rng: random.Random, text: str) -> str:
    root = ElementTree.fromstring(text)
    parents = [each for each in root.iter() if len(each)]
    if not parents:
        return text
    parent = rng.choice(parents)
    child = rng.choice(list(parent))
    other = rng.choice(list(root.iter()))
    match rng.randrange(6):
        case 0:
            parent.remove(child)
        case 1:
            copy = ElementTree.fromstring(ElementTree.tostring(other))
            parent.insert(rng.randrange(len(parent) + 1), copy)
        case 2:
            parent.extend([child] * rng.choice([1, 5, 200]))
        case 3:
            child.tag = other.tag
        case 4:
            child.text = rng.choice([*_WORDS, other.text or ""])
        case _:
            names = ("name", "relative_to", "placement_frame", "attached_to", "degrees")
            child.set(rng.choice(names), rng.choice(_WORDS))
    return ElementTree.tostring(root, encoding="unicode")
