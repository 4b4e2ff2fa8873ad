"""The look of the floor of an MJCF file: the colour of its plane, or the squares of its material."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final
from xml.etree.ElementTree import Element

from sim_action.core.records import dataclass
from sim_action.robot.documents.urdf_elements import is_numbers
from sim_action.robot.model.mjcf_data import FloorLook

# MuJoCo's default colours, of a geom and of a texture.
_NO_COLOUR: Final = [0.5, 0.5, 0.5, 1.0]
_FIRST, _SECOND = "0.8 0.8 0.8", "0.5 0.5 0.5"

# m: smaller squares could not be told apart, and larger ones are not seen as such.
_MIN_SQUARE_M: Final = 0.01
_MAX_SQUARE_M: Final = 1_000.0


@dataclass(frozen=True, slots=True)
class Pattern:
    """A texture that MuJoCo computes, on a material.

    Attributes:
        first, second: red, green and blue; the second one is that of every other square, None without squares.
        repeats: pictures along the x axis, in a metre or on the whole plane; a picture has two squares along a side.
        is_uniform: True if they are those in a metre.
    """

    first: tuple[float, ...]
    second: tuple[float, ...] | None
    repeats: float
    is_uniform: bool


def patterns_of(root: Element) -> dict[str, Pattern]:
    """Return name of a material -> its pattern, for materials with a texture that MuJoCo computes."""
    textures = {texture.get("name"): texture for texture in root.iterfind("asset/texture") if not texture.get("file")}
    return dict(_patterns(root, textures))


def _patterns(root: Element, textures: Mapping[str | None, Element]) -> Iterator[tuple[str, Pattern]]:
    for material in root.iterfind("asset/material"):
        texture = textures.get(material.get("texture", ""))
        kind = "none" if texture is None else texture.get("builtin", "none")
        if texture is None or kind == "none":
            continue
        first, second = (_numbers(texture, name, usual) for name, usual in (("rgb1", _FIRST), ("rgb2", _SECOND)))
        stated = material.get("texrepeat", "")
        repeats = float(stated.split()[0]) if is_numbers(stated, 2) else 1.0
        is_uniform = material.get("texuniform") == "true"
        yield (
            material.get("name", ""),
            Pattern(first, second if kind == "checker" else None, abs(repeats) or 1.0, is_uniform),
        )


def _numbers(texture: Element, name: str, usual: str) -> tuple[float, ...]:
    stated = texture.get(name, usual)
    return tuple(map(float, (stated if is_numbers(stated, 3) else usual).split()))


def floor_look(spec: Any, geom: Any, patterns: Mapping[str, Pattern]) -> FloorLook | None:
    """Return how a plane is drawn: its colour, or the squares of its material; None if the file does not say."""
    material = next((each for each in spec.materials if each.name == geom.material), None)
    tint = geom.rgba.tolist()
    if tint == _NO_COLOUR and material is not None:
        tint = material.rgba.tolist()
    pattern = patterns.get(geom.material)
    if pattern is None:
        return None if tint in (_NO_COLOUR, [1.0] * 4) else FloorLook(_tinted((1.0, 1.0, 1.0), tint))
    if pattern.second is None:
        return FloorLook(_tinted(pattern.first, tint))
    # A plane without an end repeats pictures in each metre, too.
    extent = float(geom.size[0])
    side = extent / pattern.repeats if extent > 0 and not pattern.is_uniform else 0.5 / pattern.repeats
    square = min(_MAX_SQUARE_M, max(_MIN_SQUARE_M, side))
    return FloorLook(_tinted(pattern.first, tint), _tinted(pattern.second, tint), square)


def _tinted(colour: tuple[float, ...], tint: list[float]) -> tuple[float, float, float]:
    red, green, blue = (round(min(1.0, max(0.0, a * b)), 3) for a, b in zip(colour, tint, strict=False))
    return red, green, blue
