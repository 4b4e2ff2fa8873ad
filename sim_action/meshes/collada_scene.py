"""What the scene of a COLLADA file shows, and where."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Final
from xml.etree.ElementTree import Element

from sim_action.meshes.collada_document import Document

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_MAX_DEPTH: Final = 100
_MAX_NODES: Final = 20_000


def shown_geometries(document: Document) -> Iterator[tuple[Element, NDArray[np.float64]]]:
    """Each <geometry> that is shown, and the matrix (4, 4) that puts it into the mesh's frame, in m.

    Of a file without a scene, that is each that it holds. Raises MeshError.
    """
    import numpy as np

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
    """One way through the nodes of a scene; a node that is used twice is seen twice."""

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
                message = "a skin that a skeleton moves has no shape of its own; export the surface alone"
                raise self._document.error(child, message)

    def _node(
        self, node: Element, placed: NDArray[np.float64], depth: int
    ) -> Iterator[tuple[Element, NDArray[np.float64]]]:
        self._seen += 1
        if depth == _MAX_DEPTH:
            raise self._document.error(node, f"more than {_MAX_DEPTH} nodes inside each other")
        if self._seen > _MAX_NODES:
            raise self._document.error(node, f"the scene shows more than {_MAX_NODES:,} nodes", "too-large-mesh")
        yield from self.below(node, _transformed(self._document, node, placed), depth + 1)


def _transformed(document: Document, node: Element, placed: NDArray[np.float64]) -> NDArray[np.float64]:
    """The transformations of a node, in the order of the file: the last acts on the points first."""
    import numpy as np

    for element in node:
        if element.tag in _TRANSFORMATIONS:
            count, matrix = _TRANSFORMATIONS[element.tag]
            numbers = document.numbers(element)
            if len(numbers) != count:
                raise document.error(element, f"expected {count} numbers, found {len(numbers)}")
            with np.errstate(over="ignore", invalid="ignore"):  # refused with the points
                placed = placed @ matrix(numbers)
        elif element.tag in ("lookat", "skew"):
            raise document.error(element, "is not read; bake it into the points, or give a <matrix>")
    return placed


def _matrix(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    return numbers.reshape(4, 4)


def _translate(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    import numpy as np

    matrix = np.eye(4)
    matrix[:3, 3] = numbers
    return matrix


def _scale(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    import numpy as np

    return np.diag([*numbers, 1.0])


def _rotate(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    """About an axis by degrees (Rodrigues)."""
    import numpy as np

    x, y, z, degrees = (float(number) for number in numbers)
    length = math.hypot(x, y, z)
    x, y, z = (x / length, y / length, z / length) if length else (0.0, 0.0, 0.0)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    radians = math.radians(degrees) if math.isfinite(degrees) else math.nan
    matrix[:3, :3] += np.sin(radians) * cross + (1 - np.cos(radians)) * (cross @ cross)
    return matrix


_Transformation = tuple[int, Callable[["NDArray[np.float64]"], "NDArray[np.float64]"]]

_TRANSFORMATIONS: Final[Mapping[str, _Transformation]] = MappingProxyType(
    {"matrix": (16, _matrix), "translate": (3, _translate), "scale": (3, _scale), "rotate": (4, _rotate)}
)
"""Tag -> how many numbers it holds, and the matrix (4, 4) that they stand for."""
