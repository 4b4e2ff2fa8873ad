"""Read COLLADA (.dae): the geometries of its scene, in metres.

The unit of the file is applied but `up_axis` is ignored, as in RViz, MoveIt and PyBullet. Each instance of a geometry
becomes a part of its own, where PyBullet takes one hull of all.

The colour of a mesh file is the diffuse colour of the material with the most faces. A material with a picture has none
of its own. A material file is opened only in the folder of its mesh, without following links.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Final
from xml.etree.ElementTree import Element

from sim_action.core.lazy_numpy import NDArray, np
from sim_action.meshes.mesh import (
    Mesh,
    MeshError,
    mesh_of,
    refuse_more_parts,
    refuse_more_points,
    refuse_more_triangles,
)

if TYPE_CHECKING:
    Surface = tuple[NDArray[np.float64], NDArray[np.int64]]
    """The points (P, 3) and the triangles (T, 3), which are rows of the points."""


import re
import warnings
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET
from xml.parsers import expat

from sim_action.core.files import open_regular
from sim_action.core.lazy_numpy import NDArray
from sim_action.core.wording import shown

_MAX_ELEMENT_DEPTH: Final = 200
_MAX_ELEMENTS: Final = 200_000
_MAX_ATTRIBUTES: Final = 1_000_000
Lines = dict[Element, int]


def parse(data: bytes) -> tuple[Element, Lines]:
    """Return the root element and the line of each element. Tags lose their namespace. Raises MeshError."""
    return _Parser().parse(data)


class _Parser:
    """The parser of one file."""

    def __init__(self) -> None:
        self._builder = ET.TreeBuilder()
        self._expat = expat.ParserCreate()
        self._expat.buffer_text = True
        self._expat.StartElementHandler, self._expat.EndElementHandler = self._start, self._end
        self._expat.CharacterDataHandler, self._expat.StartDoctypeDeclHandler = self._builder.data, self._doctype
        self._lines: Lines = {}
        self._depth = 0

    def parse(self, data: bytes) -> tuple[Element, Lines]:
        if (
            data.count(b"=") > _MAX_ATTRIBUTES
        ):  # all attributes of an element are in memory before its handler is called
            raise MeshError("too-large-mesh", f"more than {_MAX_ATTRIBUTES:,} attributes")
        try:
            self._expat.Parse(data, True)
            return self._builder.close(), self._lines
        except expat.ExpatError as error:
            message = f"is not well-formed XML: {expat.errors.messages[error.code]}"
            raise MeshError("broken-mesh", message, error.lineno) from None
        except (LookupError, UnicodeError) as error:  # an encoding that Python does not know
            raise MeshError("broken-mesh", f"{error}; save it as UTF-8", 1) from None

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        if self._depth > _MAX_ELEMENT_DEPTH:
            self._refuse("broken-mesh", f"more than {_MAX_ELEMENT_DEPTH} nested elements")
        if len(self._lines) == _MAX_ELEMENTS:
            self._refuse("too-large-mesh", f"more than {_MAX_ELEMENTS:,} elements")
        element = self._builder.start(tag.rpartition(":")[2], attributes)
        self._lines[element] = self._expat.CurrentLineNumber

    def _end(self, tag: str) -> None:
        self._depth -= 1
        self._builder.end(tag.rpartition(":")[2])

    def _doctype(self, *_: object) -> None:
        self._refuse("broken-mesh", "a DOCTYPE is not allowed in a mesh")

    def _refuse(self, rule: str, message: str) -> None:
        raise MeshError(rule, message, self._expat.CurrentLineNumber)


class Document:
    """The elements of a file, by identifier."""

    def __init__(self, root: Element, lines: Lines) -> None:
        self.root = root
        self._lines = lines
        self._by_id: dict[tuple[str, str], Element] = {}
        self._numbers: dict[Element, NDArray[np.float64]] = {}
        for element in lines:
            if "id" in element.attrib:
                self._by_id.setdefault((element.tag, element.attrib["id"]), element)

    def error(self, element: Element, message: str, rule: str = "broken-mesh") -> MeshError:
        """Return an error that names an element and its line."""
        return MeshError(rule, f"<{element.tag[:40]}>: {message}", self._lines[element])

    def named(self, element: Element, attribute: str, tag: str) -> Element:
        """Return the element that an attribute refers to. Raises MeshError."""
        name = element.get(attribute, "")
        target = self._by_id.get((tag, name[1:])) if name.startswith("#") else None
        if target is None:
            raise self.error(element, f"{attribute}={shown(name)}: the file has no <{tag}> with this id")
        return target

    def whole(self, element: Element, attribute: str, *, otherwise: int) -> int:
        """Return an attribute that is a whole number from 0. Raises MeshError."""
        text = element.get(attribute, str(otherwise)).strip()
        if not (text.isascii() and text.isdigit() and len(text) < 10):
            raise self.error(element, f"{attribute}={shown(text)}: expected a whole number from 0")
        return int(text)

    def positive(self, element: Element, attribute: str) -> float:
        """Return an attribute that is a number greater than 0. Raises MeshError."""
        text = element.get(attribute, "1")
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not 0 < number < math.inf:
            raise self.error(element, f"{attribute}={shown(text)}: expected a number greater than 0")
        return number

    def numbers(self, element: Element) -> NDArray[np.float64]:
        """Return the numbers in the text of an element. Raises MeshError."""
        text = element.text or ""
        if not text.strip():
            return np.zeros(0)
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # raised for text that is not a number
            try:
                return np.fromstring(text, sep=" ")
            except (ValueError, DeprecationWarning):
                raise self.error(element, "expected numbers, found other text") from None

    def numbers_once(self, element: Element) -> NDArray[np.float64]:
        """Return the same from a cache, for an element with several references."""
        if element not in self._numbers:
            self._numbers[element] = self.numbers(element)
        return self._numbers[element]

    def rows(self, element: Element) -> NDArray[np.int64]:
        """Return the whole numbers from 0 in the text of an element. Raises MeshError."""
        indices = self.numbers(element)
        if not ((indices >= 0) & (indices < 2**31) & (indices == np.floor(indices))).all():
            raise self.error(element, "expected whole numbers from 0", "mesh-index")
        return indices.astype(np.int64)


def read_collada(data: bytes) -> Mesh:
    """Read the bytes of a file. Raises MeshError."""
    root, lines = parse(data)
    if root.tag != "COLLADA":
        raise MeshError("broken-mesh", f"is not a COLLADA file: its root element is <{root.tag[:40]}>", 1)
    document = Document(root, lines)
    return _assembled(document, shown_geometries(document))


def _assembled(document: Document, shown: Iterable[tuple[Element, NDArray[np.float64]]]) -> Mesh:
    """Assemble one mesh from geometries, each with its transformation."""
    geometries: dict[Element, tuple[NDArray[np.float64], NDArray[np.int64]]] = {}
    points, parts, counts = [np.zeros((0, 3))], [], [0, 0]
    for geometry, placed in shown:
        if geometry not in geometries:
            geometries[geometry] = read_geometry(document, geometry)
        vertices, triangles = geometries[geometry]
        parts.append(triangles + counts[0])
        counts = [counts[0] + len(vertices), counts[1] + len(triangles)]
        refuse_more_points(counts[0])
        refuse_more_triangles(counts[1])
        refuse_more_parts(len(parts))
        with np.errstate(over="ignore", invalid="ignore"):  # refused below
            # No matrix product: its last digit differs between machines.
            points.append((vertices[:, None, :] * placed[:3, :3]).sum(axis=2) + placed[:3, 3])
    return mesh_of(np.concatenate(points), parts)


_MAX_NODE_DEPTH: Final = 100
_MAX_NODES: Final = 20_000


def shown_geometries(document: Document) -> Iterator[tuple[Element, NDArray[np.float64]]]:
    """Yield each <geometry> of the scene, with its transformation (4, 4) to the mesh's frame. Raises MeshError."""
    unit = document.root.find("asset/unit")
    meter = 1.0 if unit is None else document.positive(unit, "meter")
    in_metres = np.diag([meter, meter, meter, 1.0])
    scene = _scene(document)
    if scene is None:
        yield from ((geometry, in_metres) for geometry in document.root.iterfind("library_geometries/geometry"))
    else:
        yield from _Walk(document).below(scene, in_metres, 0)


def _scene(document: Document) -> Element | None:
    instance = document.root.find("scene/instance_visual_scene")
    if instance is not None:
        return document.named(instance, "url", "visual_scene")
    return document.root.find("library_visual_scenes/visual_scene")


class _Walk:
    """A traversal of a scene's nodes; a node with two instances is visited twice."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._seen = 0

    def below(
        self, parent: Element, placed: NDArray[np.float64], depth: int
    ) -> Iterator[tuple[Element, NDArray[np.float64]]]:
        for child in parent:
            if child.tag == "node":
                yield from self._node(child, placed, depth)
            elif child.tag == "instance_node":
                yield from self._node(self._document.named(child, "url", "node"), placed, depth)
            elif child.tag == "instance_geometry":
                yield self._document.named(child, "url", "geometry"), placed
            elif child.tag == "instance_controller":
                message = (
                    "skinned meshes (<instance_controller>) are not supported; export the surface without its skeleton"
                )
                raise self._document.error(child, message)

    def _node(
        self, node: Element, placed: NDArray[np.float64], depth: int
    ) -> Iterator[tuple[Element, NDArray[np.float64]]]:
        self._seen += 1
        if depth == _MAX_NODE_DEPTH:
            raise self._document.error(node, f"more than {_MAX_NODE_DEPTH} nested nodes")
        if self._seen > _MAX_NODES:
            raise self._document.error(node, f"the scene shows more than {_MAX_NODES:,} nodes", "too-large-mesh")
        yield from self.below(node, _transformed(self._document, node, placed), depth + 1)


def _transformed(document: Document, node: Element, placed: NDArray[np.float64]) -> NDArray[np.float64]:
    """Apply the transformations of a node in file order; the last one acts on the points first."""
    for element in node:
        if element.tag in _TRANSFORMATIONS:
            count, matrix = _TRANSFORMATIONS[element.tag]
            numbers = document.numbers(element)
            if len(numbers) != count:
                raise document.error(element, f"expected {count} numbers, found {len(numbers)}")
            with np.errstate(over="ignore", invalid="ignore"):  # refused with the points
                placed = placed @ matrix(numbers)
        elif element.tag in ("lookat", "skew"):
            raise document.error(element, "is not supported; apply it to the points, or use a <matrix>")
    return placed


def _matrix(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    return numbers.reshape(4, 4)


def _translate(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    matrix = np.eye(4)
    matrix[:3, 3] = numbers
    return matrix


def _scale(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.diag([*numbers, 1.0])


def _rotate(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation about an axis by an angle in degrees (Rodrigues)."""
    x, y, z, degrees = (float(number) for number in numbers)
    length = math.hypot(x, y, z)
    x, y, z = (x / length, y / length, z / length) if length else (0.0, 0.0, 0.0)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    radians = math.radians(degrees) if math.isfinite(degrees) else math.nan
    matrix[:3, :3] += np.sin(radians) * cross + (1 - np.cos(radians)) * (cross @ cross)
    return matrix


_Transformation = tuple[int, Callable[["NDArray[np.float64]"], "NDArray[np.float64]"]]

_TRANSFORMATIONS: Final[Mapping[str, _Transformation]] = {
    "matrix": (16, _matrix),
    "translate": (3, _translate),
    "scale": (3, _scale),
    "rotate": (4, _rotate),
}
"""Tag -> count of its numbers, and the function that makes a matrix (4, 4) of them."""


_SURFACES: Final = ("triangles", "polylist", "polygons", "trifans", "tristrips")
_MAX_INPUTS: Final = 64  # limit of inputs of a surface, such as texture coordinates


def read_geometry(document: Document, geometry: Element) -> Surface:
    """Return all surfaces of a geometry as one. Raises MeshError."""
    points = [np.zeros((0, 3))]
    triangles = [np.zeros((0, 3), np.int64)]
    above = 0
    for element in geometry.iterfind("mesh/*"):
        if element.tag in _SURFACES:
            vertices, rows = _surface(document, element)
            points.append(vertices)
            triangles.append(rows + above)
            above += len(vertices)
    return np.concatenate(points), np.concatenate(triangles)


def _surface(document: Document, element: Element) -> Surface:
    """Return the triangles of an element and the points that they use."""
    named, triangles = _corners(document, element)
    if not len(triangles):
        return np.zeros((0, 3)), triangles
    points = _points(document, named)
    # The cost depends on the corners only, because many surfaces may share one large source of points.
    used, rows = np.unique(triangles, return_inverse=True)
    if used[-1] >= len(points):
        message = f"refers to point {used[-1]:,} (from 0), but there are only {len(points):,}; export the mesh again"
        raise document.error(element, message, "mesh-index")
    return points[used], rows.reshape(-1, 3)


def _points(document: Document, vertex_input: Element) -> NDArray[np.float64]:
    """Return the points of an input of a surface."""
    vertices = document.named(vertex_input, "source", "vertices")
    positions = _input(document, vertices, "POSITION")
    source = document.named(positions, "source", "source")
    accessor = source.find("technique_common/accessor")
    if accessor is None:
        raise document.error(source, "it has no <technique_common> with an <accessor>")
    numbers = document.numbers_once(document.named(accessor, "source", "float_array"))
    stride = document.whole(accessor, "stride", otherwise=1)
    if not 3 <= stride <= _MAX_INPUTS:
        raise document.error(
            accessor, f"stride={stride}: expected 3 to {_MAX_INPUTS}, because a point has three coordinates"
        )
    numbers = numbers[document.whole(accessor, "offset", otherwise=0) :]
    return numbers[: len(numbers) // stride * stride].reshape(-1, stride)[:, :3]


def _corners(document: Document, element: Element) -> tuple[Element, NDArray[np.int64]]:
    """Return the vertex input of a surface, and its triangles as indices of that input's points."""
    vertex = _input(document, element, "VERTEX")
    width = 1 + max(document.whole(other, "offset", otherwise=0) for other in element.iterfind("input"))
    if width > _MAX_INPUTS:
        raise document.error(element, f"more than {_MAX_INPUTS} inputs")
    runs = [document.rows(run) for run in element.iterfind("p")]
    corners = np.concatenate(runs) if runs else np.zeros(0, np.int64)
    counts = _counts(document, element, [len(run) // width for run in runs])
    if counts.sum() * width != len(corners) or any(len(run) % width for run in runs):
        raise document.error(element, f"its <p> do not hold {width} numbers for each corner: was the file cut off?")
    corners = corners[document.whole(vertex, "offset", otherwise=0) :: width]
    # Split polygons into triangles; a polygon is treated as a fan about its first corner.
    triangle_counts = np.maximum(counts - 2, 0)
    refuse_more_triangles(int(triangle_counts.sum()))
    starts = np.repeat(np.cumsum(counts) - counts, triangle_counts)
    nth = np.arange(triangle_counts.sum()) - np.repeat(np.cumsum(triangle_counts) - triangle_counts, triangle_counts)
    first = starts + (nth if element.tag == "tristrips" else 0)
    triangles: NDArray[np.int64] = corners[np.stack([first, starts + nth + 1, starts + nth + 2], axis=1)]
    return vertex, triangles


def _counts(document: Document, element: Element, runs: list[int]) -> NDArray[np.int64]:
    """Return the number of corners of each polygon, strip or fan."""
    if element.tag == "triangles":
        return np.full(sum(runs) // 3, 3)
    if element.tag != "polylist":
        return np.array(runs, np.int64)
    stated = element.find("vcount")
    return document.rows(stated) if stated is not None else np.zeros(0, np.int64)


def _input(document: Document, element: Element, semantic: str) -> Element:
    input_tag = element.find(f"input[@semantic='{semantic}']")
    if input_tag is None:
        raise document.error(element, f'it has no <input semantic="{semantic}">')
    return input_tag


Colour = tuple[float, float, float]  # red, green and blue, each 0 to 1
_MAX_MATERIAL_BYTES: Final = 1_000_000
_MAX_FILES: Final = 8


def colour_of(path: Path, data: bytes) -> Colour | None:
    """Return the colour of a mesh file with these bytes, which were read as a mesh before; None if it has none."""
    kind = path.suffix.lower()
    if kind == ".obj":
        return _of_obj(path, data)
    return _of_collada(data) if kind == ".dae" else None


def _of_obj(path: Path, data: bytes) -> Colour | None:
    head, *parts = b"\n".join((b"", data)).split(b"\nusemtl ")
    faces = Counter[bytes]()
    for part in parts:
        faces[part.partition(b"\n")[0].strip()] += part.count(b"\nf ")
    if not faces:
        return None
    name = faces.most_common(1)[0][0]
    named = head.split(b"\nmtllib ")[1 : _MAX_FILES + 1]
    libraries = [library.partition(b"\n")[0].strip() for library in named]
    colours = dict(pair for library in libraries for pair in _materials(_beside(path, library)))
    return colours.get(name)


def _beside(path: Path, name: bytes) -> bytes:
    """Return the content of a file in the folder of a mesh; empty if there is none of this name."""
    plain = Path(name.decode(errors="replace")).name
    try:
        with open_regular(path.parent / plain, follow_link=False) as file:
            return file.read(_MAX_MATERIAL_BYTES)
    except (OSError, ValueError):  # a NUL in the name
        return b""


def _materials(text: bytes) -> Iterator[tuple[bytes, Colour | None]]:
    for part in re.split(rb"^[ \t]*newmtl[ \t]+", text, flags=re.MULTILINE)[1:]:
        name, _, rest = part.partition(b"\n")
        stated = re.search(rb"^[ \t]*Kd[ \t]+([^\r\n]+)", rest, re.MULTILINE)
        has_picture = re.search(rb"^[ \t]*map_Kd\b", rest, re.MULTILINE)
        yield name.strip(), None if stated is None or has_picture else stated_colour(stated[1].decode(errors="replace"))


def _of_collada(data: bytes) -> Colour | None:
    root, _ = parse(data)
    faces = Counter[str]()
    for surface in root.iterfind("library_geometries/geometry/mesh/*"):
        if surface.tag in _SURFACES:
            count = surface.get("count", "")
            faces[surface.get("material", "")] += int(count) if count.isdecimal() and len(count) < 10 else 0
    if not faces:
        return None
    symbol = faces.most_common(1)[0][0]
    bound = {
        instance.get("symbol"): instance.get("target", "").removeprefix("#")
        for instance in root.iter("instance_material")
    }
    effects = {
        material.get("id"): effect.get("url", "").removeprefix("#")
        for material in root.iterfind("library_materials/material")
        for effect in material.iterfind("instance_effect")
    }
    colours = {
        effect.get("id"): effect.findtext("profile_COMMON/technique/*/diffuse/color")
        for effect in root.iterfind("library_effects/effect")
    }
    return stated_colour(colours.get(effects.get(bound.get(symbol, symbol))) or "")


def stated_colour(text: str) -> Colour | None:
    """Return the first three numbers of a text, from 0 to 1; None if they are no numbers."""
    try:
        red, green, blue = (float(word) for word in text.split()[:3])
    except ValueError:
        return None
    if not math.isfinite(red + green + blue):
        return None
    red, green, blue = (min(1.0, max(0.0, part)) for part in (red, green, blue))
    return red, green, blue
