"""What links look like, as URDF has it: <visual> with its shape and the colour of its material."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core.geometry import Vector3
from sim_action.robot.document import ModelDocument
from sim_action.robot.robot_model import Color, Visual
from sim_action.robot.values import SHAPES, is_numbers, origin, vector

_LENGTHS: Final = {"size": 3}


def materials(document: ModelDocument) -> dict[str, Color]:
    """Name -> colour, of those that stand beside the links or in any of them."""
    found: dict[str, Color] = {}
    for material in document.elements("link/visual/material", "material"):
        color, name = _stated(material), material.get("name")
        if color is not None and name:
            found[name] = color
    return found


def visuals_of(link: Element, colors: Mapping[str, Color], meshes: Mapping[Element, Path]) -> Iterator[Visual]:
    """Those of a link that can be drawn; `meshes`: where the files of <mesh> elements are."""
    for visual in link.findall("visual"):
        shape = next(iter(visual.findall("geometry/*")), None)
        if shape is None:
            continue
        material = visual.find("material")
        color = None if material is None else _stated(material) or colors.get(material.get("name", ""))
        if shape in meshes:
            scale = vector(shape, "scale", (1.0, 1.0, 1.0))
            yield Visual("mesh", origin(visual), color, file=str(meshes[shape]), scale=scale)
        elif (size := _size(shape)) is not None:
            yield Visual(shape.tag, origin(visual), color, size)


def _stated(material: Element) -> Color | None:
    """The alpha of a colour is left: what is hard to see in a picture is easily overlooked."""
    color = material.find("color")
    text = "" if color is None else color.get("rgba", "")
    if not is_numbers(text, 4):
        return None
    red, green, blue = (min(1.0, max(0.0, float(part))) for part in text.split()[:3])
    return (red, green, blue)


def _size(shape: Element) -> Vector3 | None:
    """Of the box around it, in m; None for what is no plain shape, or has no size."""
    names = SHAPES.get(shape.tag)
    if names is None or not all(is_numbers(shape.get(name, ""), _LENGTHS.get(name, 1)) for name in names):
        return None
    numbers = [float(part) for name in names for part in shape.get(name, "").split()]
    if min(numbers) <= 0:
        return None
    if shape.tag == "box":
        x, y, z = numbers
        return (x, y, z)
    across = 2 * numbers[0]
    height = {"sphere": across, "cylinder": numbers[-1], "capsule": numbers[-1] + across}[shape.tag]
    return (across, across, height)
