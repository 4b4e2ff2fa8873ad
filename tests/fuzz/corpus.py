"""Inputs that once found a fault, or that stand for one that was mended. All of them are tried by `make test`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from tests.fuzz.cases import SCENARIO, Case
from tests.mesh_files import obj

_KEYS: Final = "name: s\ntime_limit: 0.1 s\n"
_PLAIN: Final = f"{_KEYS}expect: [upright: {{max_tilt: 20 deg}}]\n"
_BURGER: Final = f"{_PLAIN}robot: {{model: turtlebot3_burger}}\n"
_LATE: Final = _BURGER.replace("[upright", "[{upright").replace("deg}]", "deg}, after: 1.7e308}]")
_ROBOT: Final = f"{_PLAIN}robot: {{model: r.urdf}}\n"
_LINK: Final = """\
<robot name="a"><link name="b"><inertial><mass value="1"/>
<inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>SHAPES</link></robot>
"""
_SHAPE: Final = '<collision><origin xyz="{} 0 0"/><geometry>{}</geometry></collision>'
_VISUAL: Final = '<visual><geometry><mesh filename="m.obj" scale="-"/></geometry></visual>'


def _case(kind: str, scenario: str, victim: str = SCENARIO, **files: str | bytes) -> Case:
    """A case; `_` in the name of a file stands for a dot."""
    written = {name.replace("_", "."): data for name, data in files.items()} | {SCENARIO: scenario}
    return Case(
        kind, {name: data.encode() if isinstance(data, str) else data for name, data in written.items()}, victim
    )


def _obj_with(corner: str) -> Case:
    world = "world: {objects: [{name: w, mesh: {file: m.obj}, pose: {x: 9}}]}\n"
    return _case("mesh", f"{_BURGER}{world}", "m.obj", m_obj=obj() + f"f 1 2 {corner}\n".encode())


def _link_of(*shapes: str) -> Case:
    several = "".join(_SHAPE.format(place, shape) for place, shape in enumerate(shapes))
    return _case("model", _ROBOT, "r.urdf", r_urdf=_LINK.replace("SHAPES", several), m_obj=obj(), n_obj=obj() + b"\n")


_MESHES: Final = ('<mesh filename="m.obj"/>', '<mesh filename="n.obj"/>')

CORPUS: Final[Mapping[str, Case]] = {
    # An OverflowError, and exit code 3.
    "OBJ index beyond 64 bits": _obj_with("9223372036854775808"),
    "OBJ index below 64 bits": _obj_with("-9223372036854775809"),
    "OBJ index of 400 digits": _obj_with("1" + "0" * 399),
    # An IndexError, and exit code 3: the steps between two rows were beyond 64 bits.
    "trace rate near zero": _case("scenario", f"{_BURGER}trace: {{rate: 1e-300}}\n"),
    "command rate near zero": _case("scenario", f"{_BURGER}commands: {{twist: [{{linear: 1}}], rate: 1e-300 Hz}}\n"),
    # An OverflowError, and exit code 3.
    "segment of no length": _case("scenario", f"{_BURGER}commands: {{twist: [{{linear: 1, for: 1e-320}}, {{}}]}}\n"),
    "segment without end": _case(
        "scenario", f"{_BURGER}commands: {{twist: [{{linear: 1, for: 1.7e308}}, {{for: 1}}], rate: 20 Hz}}\n"
    ),
    "window after all time": _case("scenario", _LATE),
    "window of no length": _case(
        "scenario",
        f"{_KEYS}robot: {{model: turtlebot3_burger}}\n"
        "world: {objects: [{name: w, box: [1, 1, 1], pose: {x: 9}}]}\n"
        "expect: [contact: {with: w, window: 1e-320, at_most: 1}]\n",
    ),
    # An OSError, and exit code 3.
    "long name of a program": _case("scenario", f"{_BURGER}commands: {{process: {'x' * 5000}, rate: 20 Hz}}\n"),
    # Refused by PyBullet's engine, although nothing is wrong with it.
    "two meshes on a link": _link_of(*_MESHES),
    "box and mesh on a link": _link_of('<box size="1 1 1"/>', _MESHES[0]),
    # A ValueError, and exit code 3: the scale of a mesh that is only drawn was not checked.
    "scale of a visual": _case("model", _ROBOT, "r.urdf", m_obj=obj(), r_urdf=_LINK.replace("SHAPES", _VISUAL)),
    # The message did not name the file.
    "joint of a log": _case("log", f"{_BURGER}commands: {{replay: f.csv, rate: 20 Hz}}\n", "f.csv",
                            f_csv="time,velocity.elbow\n0,1\n"),
    "image of a map": _case("map", f"{_BURGER}world: {{objects: [{{name: w, map: {{file: f.yaml}}}}]}}\n", "f.yaml",
                            f_yaml="image: m.png<<\nresolution: 0.1\norigin: [0, 0, 0]\n"),
}  # fmt: skip
"""Name -> input."""
