"""COLLADA files in the forms that exporters write: FBX, Blender and SketchUp."""

from collections.abc import Sequence

import numpy as np

QUADS = (
    *((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4)),
    *((1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
)
CORNERS = np.array(
    [(x, y, z) for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
)
IDENTITY = "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"

FILE = """<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset>
    <created>2018-10-11T08:18:38Z</created>
    <unit meter="{unit}" name="unit"/><up_axis>{up_axis}</up_axis>
  </asset>
  <library_images><image id="i"><init_from>file:///etc/passwd</init_from></image>
  </library_images>
  <library_visual_scenes><visual_scene id="scene">{scene}
  </visual_scene></library_visual_scenes>
  <library_nodes>{nodes}</library_nodes>
  <library_geometries>{geometries}</library_geometries>
  <scene><instance_visual_scene url="#scene"/></scene>
</COLLADA>
"""
GEOMETRY = """
    <geometry id="{id}"><mesh>
      <source id="{id}-p"><float_array id="{id}-pa" count="24">{positions}</float_array>
        <technique_common><accessor source="#{id}-pa" count="8" stride="3">
          <param name="X" type="float"/><param name="Y" type="float"/>
          <param name="Z" type="float"/></accessor></technique_common></source>
      <source id="{id}-n"><float_array id="{id}-na" count="3">0 0 1</float_array>
        <technique_common><accessor source="#{id}-na" count="1" stride="3">
          <param name="X" type="float"/><param name="Y" type="float"/>
          <param name="Z" type="float"/></accessor></technique_common></source>
      <vertices id="{id}-v"><input semantic="POSITION" source="#{id}-p"/></vertices>
      {primitives}
    </mesh></geometry>"""
INPUTS = """<input semantic="VERTEX" offset="0" source="#{id}-v"/>
        <input semantic="NORMAL" offset="1" source="#{id}-n"/>"""
# The material is missing, as it often is where textures were left behind.
INSTANCE = """<instance_geometry url="#{id}"><bind_material><technique_common>
      <instance_material symbol="stone" target="#nowhere"/>
    </technique_common></bind_material></instance_geometry>"""


def box_geometry(id_: str, size: Sequence[float], form: str = "triangles") -> str:
    """Return a box about the origin, as triangles, a polylist or polygons."""
    positions = " ".join(map(str, (CORNERS * np.array(size) / 2).ravel()))
    inputs, tag = INPUTS.format(id=id_), f'{form} material="stone"'
    quads = [" ".join(f"{corner} 0" for corner in quad) for quad in QUADS]
    if form == "triangles":
        corners = [[quad[i] for i in (0, 1, 2, 0, 2, 3)] for quad in QUADS]
        indices = " ".join(f"{each} 0" for six in corners for each in six)
        body = f'<{tag} count="12">{inputs}<p>{indices}</p></{form}>'
    elif form == "polylist":
        counts = "<vcount>4 4 4 4 4 4 </vcount>"
        body = f'<{tag} count="6">{inputs}{counts}<p>{" ".join(quads)}</p></{form}>'
    else:
        lists = "".join(f"<p>{quad}</p>" for quad in quads)
        body = f'<{tag} count="6">{inputs}{lists}</{form}>'
    return GEOMETRY.format(id=id_, positions=positions, primitives=body)


def box_file(
    size: Sequence[float],
    form: str = "triangles",
    *,
    unit: float = 1.0,
    up_axis: str = "Z_UP",
    at: Sequence[float] = (0, 0, 0),
) -> str:
    """Return a file with one box, m, whose node is called ``Box``."""
    small = [each / unit for each in size]
    where = " ".join(str(each / unit) for each in at)
    node = f"""
    <node id="Box" name="Box"><translate>{where}</translate>
      <rotate>0 0 1 0</rotate><scale>1 1 1</scale>{INSTANCE.format(id="g")}</node>"""
    geometry = box_geometry("g", small, form)
    return FILE.format(
        unit=unit, up_axis=up_axis, scene=node, nodes="", geometries=geometry
    )


def two_boxes_file(size: Sequence[float], apart: float) -> str:
    """Return a file with two boxes, ``left`` and ``right``, by nodes of a library."""
    nodes = "".join(
        f"""<node name="{name}"><matrix>1 0 0 {x} 0 1 0 0 0 0 1 0 0 0 0 1</matrix>
        <instance_node url="#box"/></node>"""
        for name, x in (("left", -apart / 2), ("right", apart / 2))
    )
    scene = f'<node name="SketchUp"><matrix>{IDENTITY}</matrix>{nodes}</node>'
    library = f'<node id="box">{INSTANCE.format(id="g")}</node>'
    return FILE.format(
        unit=1,
        up_axis="Z_UP",
        scene=scene,
        nodes=library,
        geometries=box_geometry("g", size),
    )
