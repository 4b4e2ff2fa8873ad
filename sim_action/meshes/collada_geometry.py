"""The triangles of one <geometry>."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final
from xml.etree.ElementTree import Element

from sim_action.meshes.collada_document import Document
from sim_action.meshes.mesh import refuse_more_triangles

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Surface = tuple[NDArray[np.float64], NDArray[np.int64]]
    """Points (P, 3), and triangles (T, 3) that are rows of them."""

_SURFACES: Final = ("triangles", "polylist", "polygons", "trifans", "tristrips")

# Inputs of a surface, such as texture coordinates: there are a handful.
_MAX_INPUTS: Final = 64


def read_geometry(document: Document, geometry: Element) -> Surface:
    """All its surfaces, as one. Raises MeshError."""
    import numpy as np

    points, triangles, above = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
    for element in geometry.iterfind("mesh/*"):
        if element.tag in _SURFACES:
            found, rows = _surface(document, element)
            points.append(found)
            triangles.append(rows + above)
            above += len(found)
    return np.concatenate(points), np.concatenate(triangles)


def _surface(document: Document, element: Element) -> Surface:
    """The triangles of an element, and those points that they use."""
    import numpy as np

    named, triangles = _corners(document, element)
    if not len(triangles):
        return np.zeros((0, 3)), triangles
    points = _points(document, named)
    # Takes as long as there are corners: many surfaces may share a source of many points.
    used, rows = np.unique(triangles, return_inverse=True)
    if used[-1] >= len(points):
        message = f"names point {used[-1]:,}, counted from 0, and there are {len(points):,}; export the mesh again"
        raise document.error(element, message, "mesh-index")
    return points[used], rows.reshape(-1, 3)


def _points(document: Document, vertex_input: Element) -> NDArray[np.float64]:
    """Where the points are that an input of a surface stands for."""
    vertices = document.named(vertex_input, "source", "vertices")
    positions = _input(document, vertices, "POSITION")
    source = document.named(positions, "source", "source")
    accessor = source.find("technique_common/accessor")
    if accessor is None:
        raise document.error(source, "there is no <technique_common> with an <accessor> in it")
    numbers = document.numbers_once(document.named(accessor, "source", "float_array"))
    stride = document.whole(accessor, "stride", otherwise=1)
    if not 3 <= stride <= _MAX_INPUTS:
        raise document.error(accessor, f"stride={stride}: a point has three coordinates")
    numbers = numbers[document.whole(accessor, "offset", otherwise=0) :]
    return numbers[: len(numbers) // stride * stride].reshape(-1, stride)[:, :3]


def _corners(document: Document, element: Element) -> tuple[Element, NDArray[np.int64]]:
    """The input that says where a surface's points are, and its triangles, rows of that input's points."""
    import numpy as np

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
    return vertex, _triangulated(corners, counts, is_strip=element.tag == "tristrips")


def _counts(document: Document, element: Element, runs: list[int]) -> NDArray[np.int64]:
    """How many corners each polygon has, or each strip or fan of triangles."""
    import numpy as np

    if element.tag == "triangles":
        return np.full(sum(runs) // 3, 3)
    if element.tag != "polylist":
        return np.array(runs, np.int64)
    stated = element.find("vcount")
    return document.rows(stated) if stated is not None else np.zeros(0, np.int64)


def _triangulated(corners: NDArray[np.int64], counts: NDArray[np.int64], *, is_strip: bool) -> NDArray[np.int64]:
    """A polygon is taken for the fan of triangles about its first corner."""
    import numpy as np

    each = np.maximum(counts - 2, 0)
    refuse_more_triangles(int(each.sum()))
    starts = np.repeat(np.cumsum(counts) - counts, each)
    nth = np.arange(each.sum()) - np.repeat(np.cumsum(each) - each, each)
    first = starts + (nth if is_strip else 0)
    triangles: NDArray[np.int64] = corners[np.stack([first, starts + nth + 1, starts + nth + 2], axis=1)]
    return triangles


def _input(document: Document, element: Element, semantic: str) -> Element:
    found = element.find(f"input[@semantic='{semantic}']")
    if found is None:
        raise document.error(element, f'there is no <input semantic="{semantic}"> in it')
    return found
