"""Visuals of SDF -> those of URDF."""

from __future__ import annotations

from typing import Final
from xml.etree.ElementTree import Element

from sim_action.robot.sdf.writing import UrdfWriter
from sim_action.robot.values import is_numbers

# Of each plain shape, what has to be said, and in how many numbers.
_SIZES: Final = {
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
}


def looks_in(visual: Element) -> Element | None:
    """Its shape; None for what is no mesh, and no plain shape of a size: nobody misses it."""
    shape = next(iter(visual.findall("geometry/*")), None)
    if shape is None or shape.tag == "mesh":
        return shape
    sizes = _SIZES.get(shape.tag, {})
    stated = all(is_numbers(shape.findtext(name) or "", count) for name, count in sizes.items())
    return shape if sizes and stated else None


def write_colour(writer: UrdfWriter, written: Element, visual: Element) -> None:
    """Writes the colour of a visual, if it states one: red, green, blue, and what shines through, which may be left."""
    words = (visual.findtext("material/diffuse") or "").split()[:3]
    text = " ".join(words)
    if is_numbers(text, 3):
        material = writer.add(written, "material", visual, name=f"of visual '{visual.get('name', '')}'")
        writer.add(material, "color", visual, rgba=f"{text} 1")
