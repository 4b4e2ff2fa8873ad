"""Mesh files as programs write them: one box, told in every format."""

from __future__ import annotations

import itertools
import math
import re
import struct
from collections.abc import Callable, Iterable, Sequence

Point = tuple[float, float, float]
Face = Sequence[int]
HALF = (0.1, 0.2, 0.3)  # of the box, in m: it lies about the origin
CORNERS: list[Point] = [(x, y, z) for x in (-0.1, 0.1) for y in (-0.2, 0.2) for z in (-0.3, 0.3)]
SIDES: list[Face] = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def fans(faces: Iterable[Face]) -> list[Face]:
    return [(face[0], b, c) for face in faces for b, c in itertools.pairwise(face[1:])]


TRIANGLES = fans(SIDES)


def moved(points: Iterable[Point], x: float) -> list[Point]:
    return [(px + x, py, pz) for px, py, pz in points]


def stl(points: Sequence[Point] = CORNERS, faces: Sequence[Face] = SIDES, header: bytes = b"") -> bytes:
    triangles = fans(faces)
    facets = (struct.pack("<12fH", 0, 0, 0, *points[a], *points[b], *points[c], 0) for a, b, c in triangles)
    return header.ljust(80) + struct.pack("<I", len(triangles)) + b"".join(facets)


def ascii_stl(
    points: Sequence[Point] = CORNERS, triangles: Iterable[Face] = TRIANGLES, name: str = "box of steel"
) -> bytes:
    def facet(corners: Face) -> str:
        vertices = "".join("      vertex {} {} {}\n".format(*points[corner]) for corner in corners)
        return f"  facet normal 0 0 0\n    outer loop\n{vertices}    endloop\n  endfacet\n"

    return f"solid {name}\n{''.join(map(facet, triangles))}endsolid {name}\n".encode()


def obj(
    points: Iterable[Point] = CORNERS,
    faces: Iterable[Face] = TRIANGLES,
    before: str = "",
    corner: Callable[[int], str] = lambda row: str(row + 1),
) -> bytes:
    vertices = "".join("v {} {} {}\n".format(*point) for point in points)
    return f"{before}{vertices}{''.join('f ' + ' '.join(map(corner, face)) + chr(10) for face in faces)}".encode()


def two_objects(between: str = "o right") -> bytes:
    """The box at x = 0, and the same at x = 1."""
    right = obj(moved(CORNERS, 1), corner=lambda row: str(row + 9))
    return b"o left\n" + obj() + f"{between}\n".encode() + right


SHOWN = '<instance_geometry url="#box"/>'
INDICES = " ".join(str(row) for triangle in TRIANGLES for row in triangle)
SURFACE = '<triangles count="12"><input semantic="VERTEX" source="#vertices" offset="0"/><p>{}</p></triangles>'


def dae(
    surface: str = SURFACE.format(INDICES), node: str = SHOWN, asset: str = "", points: Iterable[Point] = CORNERS
) -> bytes:
    numbers = [number for point in points for number in point]
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset>{asset}</asset>
  <library_geometries><geometry id="box"><mesh>
    <source id="positions">
      <float_array id="array" count="{len(numbers)}">{" ".join(map(str, numbers))}</float_array>
      <technique_common><accessor source="#array" count="{len(numbers) // 3}" stride="3"/></technique_common>
    </source>
    <vertices id="vertices"><input semantic="POSITION" source="#positions"/></vertices>
    {surface}
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="all"><node id="shown">{node}</node></visual_scene></library_visual_scenes>
  <scene><instance_visual_scene url="#all"/></scene>
</COLLADA>
""".encode()


def two_instances() -> bytes:
    """The box at x = 0, and the same at x = 1."""
    return dae(node=f"{SHOWN}<node><translate>1 0 0</translate>{SHOWN}</node>")


L_POINTS: list[Point] = [
    (x, y, z) for z in (0, 0.2) for x, y in ((0, 0), (1, 0), (1, 0.2), (0.2, 0.2), (0.2, 1), (0, 1))
]
L_FACES: list[Face] = [
    (0, 3, 2, 1),
    (0, 5, 4, 3),
    (6, 7, 8, 9),
    (6, 9, 10, 11),
    *((row, (row + 1) % 6, (row + 1) % 6 + 6, row + 6) for row in range(6)),
]
"""An L that lies in the corner of its box (1, 1, 0.2): the far corner, at (1, 1), is empty."""


def ball(radius: float = 0.1, rings: int = 20, spokes: int = 40) -> tuple[list[Point], list[Face]]:
    heights = [math.pi * ring / rings for ring in range(1, rings)]
    turns = [2 * math.pi * spoke / spokes for spoke in range(spokes)]
    points = [(math.sin(h) * math.cos(t), math.sin(h) * math.sin(t), math.cos(h)) for h in heights for t in turns]
    rows = [[ring * spokes + spoke for spoke in range(spokes)] for ring in range(rings - 1)]
    faces: list[Face] = [
        (above[spoke - 1], above[spoke], below[spoke], below[spoke - 1])
        for above, below in itertools.pairwise(rows)
        for spoke in range(spokes)
    ]
    caps: list[Face] = [rows[0], rows[-1]]
    return [(radius * x, radius * y, radius * z) for x, y, z in points], faces + caps


def wheel(radius: float, width: float, spokes: int = 64) -> tuple[list[Point], list[Face]]:
    """A cylinder about z."""
    turns = [2 * math.pi * spoke / spokes for spoke in range(spokes)]
    points = [(radius * math.cos(t), radius * math.sin(t), z) for z in (-width / 2, width / 2) for t in turns]
    rim: list[Face] = [
        (spoke, (spoke + 1) % spokes, (spoke + 1) % spokes + spokes, spoke + spokes) for spoke in range(spokes)
    ]
    return points, [*rim, range(spokes), range(spokes, 2 * spokes)]


POLYLIST = """<polylist count="6"><input semantic="VERTEX" source="#vertices" offset="1"/>
  <input semantic="NORMAL" source="#normals" offset="0"/><vcount>4 4 4 4 4 4</vcount><p>{}</p></polylist>"""
POLYGONS = '<polygons><input semantic="VERTEX" source="#vertices"/>{}</polygons>'
STRIPS = '<{0}><input semantic="VERTEX" source="#vertices" offset="0"/>{1}</{0}>'

GOOD: dict[str, bytes] = {
    "binary.stl": stl(),
    "solid.stl": stl(header=b"solid box\n"),
    "ascii.stl": ascii_stl(),
    "nameless.stl": ascii_stl(name="").replace(b"solid ", b"solid"),
    "crlf.stl": ascii_stl().replace(b"\n", b"\r\n"),
    "shouted.stl": ascii_stl().upper(),
    "UPPER.STL": stl(),
    "triangles.obj": obj(),
    "quads.obj": obj(faces=SIDES),
    "backwards.obj": obj(corner=lambda row: str(row - 8)),
    "ahead.obj": obj(points=(), faces=TRIANGLES) + obj(faces=()),
    "looks.obj": obj(before="mtllib ../../etc/shadow\nvt 0 0\nvn 0 0 1\ns off\n", corner=lambda row: f"{row + 1}/9/9"),
    "edges.obj": obj(faces=[*TRIANGLES, (0, 1)]),
    "colours.obj": obj().replace(b"0.3\n", b"0.3 1 0 0\n"),
    "continued.obj": obj().replace(b"v -0.1 ", b"v \\\n-0.1 \\\n"),
    "BOX.OBJ": obj(),
    "triangles.dae": dae(),
    "polylist.dae": dae(POLYLIST.format(" ".join(f"7 {row}" for side in SIDES for row in side))),
    "polygons.dae": dae(POLYGONS.format("".join("<p>{} {} {} {}</p>".format(*side) for side in SIDES))),
    "fans.dae": dae(STRIPS.format("trifans", "".join("<p>{} {} {} {}</p>".format(*side) for side in SIDES))),
    "strips.dae": dae(STRIPS.format("tristrips", "<p>0 1 2 3 6 7 4 5 0 1</p><p>0 2 4 6</p><p>1 3 5 7</p>")),
    "surfaces.dae": dae("".join(SURFACE.format("{} {} {}".format(*triangle)) for triangle in TRIANGLES)),
    "lines.dae": dae(f'<lines count="1"><p>0 1</p></lines>{SURFACE.format(INDICES)}'),
    "prefixed.dae": re.sub(rb"<(/?)(\w)", rb"<\1c:\2", dae()).replace(b"xmlns=", b"xmlns:c="),
    "no-scene.dae": dae()[: dae().index(b"<library_visual")] + b"</COLLADA>",
    "no-asset.dae": dae().replace(b"<asset></asset>", b""),
    "up.dae": dae(asset="<up_axis>Y_UP</up_axis>"),
    "millimetres.dae": dae(asset='<unit meter="0.001"/>', points=[(1e3 * x, 1e3 * y, 1e3 * z) for x, y, z in CORNERS]),
    "BOX.DAE": dae(),
}
"""The box, as files that are as they should be, by their names."""
