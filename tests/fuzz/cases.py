"""The inputs of the fuzzer: a folder of files for each kind and seed, and the file that was damaged."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from sim_action.app.editor_schema import reachable
from sim_action.app.schema import _models
from sim_action.commands import COMMANDS
from tests.fuzz.damage import NUMBERS, TOKENS, damaged, structure_damaged
from tests.fuzz.schema_values import value
from tests.fuzz.urdf_damage import mutated
from tests.fuzz.urdf_texts import MESH, MESH_TEXT, Chance, robot_text
from tests.mesh_files import ascii_stl, dae, obj, stl, two_instances, two_objects
from tests.worlds import pgm, png

ROOT: Final = Path(__file__).parents[2]
EXAMPLES: Final = ROOT / "examples"
SCENARIO: Final = "s.sim.yml"
ANSWERS: Final = "answers.txt"


@dataclass(frozen=True, slots=True)
class Case:
    """An input."""

    kind: str  # such as "golden"
    files: Mapping[str, bytes]  # name -> content; `SCENARIO` names the others
    victim: str  # the file that was damaged
    folder: str = ""  # the folder of the examples that it needs beside it; empty if it needs none


def case(kind: str, seed: int, number: int) -> Case:
    """Return a case; the same seed and number give the same one."""
    return KINDS[kind](random.Random(f"{kind}-{seed}-{number}"))


def _scenario(**keys: object) -> bytes:
    known: dict[str, object] = {
        "name": "s",
        "robot": {"model": "turtlebot3_burger"},
        "expect": [{"upright": {"max_tilt": "20 deg"}}],
        "time_limit": "0.1 s",
    }
    return yaml.safe_dump(known | keys, sort_keys=False).encode()


def _with_world(shape: Mapping[str, object], **keys: object) -> bytes:
    return _scenario(world={"objects": [{"name": "w", **shape, "pose": {"x": 9}, **keys}]})


def _with_model(name: str) -> bytes:
    return _scenario(
        robot={"model": name, "pose": {"z": 1}},
        world={"objects": [{"name": "far", "box": [1, 1, 1], "pose": {"x": 9}}]},
        expect=["no_collision"],
    )


# Scenarios


@cache
def _examples() -> tuple[tuple[str, str, Any], ...]:
    """The scenarios of the repository: folder, name and data."""
    return tuple(
        (path.parent.name, path.name, yaml.safe_load(path.read_text(encoding="utf-8")))
        for path in sorted(EXAMPLES.glob("*/*.yml"))
        if path.parent.name not in ("workflows", "gitlab", "pre-commit", "ros1")
    )


@cache
def _schema() -> dict[str, Any]:
    scenario, definitions = _models()
    return {**scenario, "$defs": reachable(scenario, definitions.__getitem__)}


@cache
def _words() -> tuple[str, ...]:
    """All keys of the schema."""
    keys = dict.fromkeys(_schema()["properties"])
    for definition in _schema()["$defs"].values():
        keys |= dict.fromkeys(definition.get("properties", {}))
    return tuple(keys)


def _drawn(chance: Chance) -> Any:
    """A scenario from the models, which may still be wrong in its meaning."""
    schema = _schema()
    properties = {name: each for name, each in schema["properties"].items() if name not in ("extends", "scenarios")}
    optional = {"type": "object", "properties": {**properties, "commands": {}}}
    data = value(optional, schema, chance)
    if chance.random() < 0.5:
        command = COMMANDS.load(chance.choice([name for name in COMMANDS if name not in ("ros1", "ros2", "process")]))
        data["commands"] = value(schema["$defs"][command.__name__], schema, chance)
    if "robot" not in data or chance.random() < 0.7:
        data["robot"] = {"model": "turtlebot3_burger"}
    several = [value(schema["$defs"]["Expectation"], schema, chance, "expect") for _ in range(chance.choice((1, 1, 2)))]
    data.setdefault("expect", several)
    return {**data, "name": "drawn", "time_limit": "0.5 s"}


def scenario_case(chance: Chance) -> Case:
    """A scenario of the examples or of the models, with damage to its structure, its text, or both."""
    if chance.random() < 0.4:
        folder, data = "", _drawn(chance)
    else:
        folder, _, data = chance.choice(_examples())
        data = yaml.safe_load(yaml.safe_dump(data))
    how = chance.random()
    if how < 0.75:
        data = structure_damaged(data, chance, _words())
    text = yaml.dump(data, sort_keys=False, allow_unicode=True, default_flow_style=chance.choice((None, True, False)))
    if how > 0.6:
        text = _anchored(text, chance)
    raw = text.encode("utf-8", "surrogatepass")
    return Case("scenario", {SCENARIO: damaged(raw, chance) if how > 0.8 else raw}, SCENARIO, folder)


def _anchored(text: str, chance: Chance) -> str:
    """Some values get anchors, aliases, tags, or other styles."""
    lines = text.split("\n")
    for _ in range(chance.choice((1, 2, 4))):
        at = chance.randrange(len(lines))
        key, colon, rest = lines[at].partition(": ")
        new = chance.choice(("&a ", "*a", "<<: *a", "!!str ", "!x ", "|\n  ", ">-\n  ", "? ", "# ", "[", "{", "'", '"'))
        lines[at] = f"{key}{colon}{new}{rest if chance.random() < 0.7 else ''}"
    return "\n".join(lines)


# Models


_MODEL_TEXTS: Final[Mapping[str, str]] = {
    "r.sdf": """<?xml version="1.0"?>
<sdf version="1.9"><model name="cart"><link name="base"><pose>0 0 0.1 0 0 0</pose>
<inertial><mass>2.0</mass><inertia><ixx>0.1</ixx><iyy>0.1</iyy><izz>0.1</izz></inertia></inertial>
<collision name="c"><geometry><box><size>0.4 0.3 0.1</size></box></geometry></collision></link>
<link name="wheel"><pose relative_to="base">0.1 0.2 0 1.57 0 0</pose><inertial><mass>0.5</mass></inertial>
<collision name="c"><geometry><cylinder><radius>0.1</radius><length>0.05</length></cylinder></geometry>
<surface><friction><ode><mu>0.8</mu></ode></friction></surface></collision></link>
<joint name="axle" type="revolute"><parent>base</parent><child>wheel</child><axis><xyz>0 0 1</xyz>
<limit><lower>-1e16</lower><upper>1e16</upper><effort>10</effort></limit></axis></joint>
<frame name="f" attached_to="wheel"><pose>1 0 0 0 0 0</pose></frame></model></sdf>
""",
    "r.xml": """<mujoco model="cart"><compiler angle="degree"/><option timestep="0.002"/>
<default><geom friction="0.8 0.1 0.1"/></default><asset><mesh name="m" file="part.obj" scale="0.1 0.1 0.1"/></asset>
<worldbody><body name="base" pos="0 0 0.2"><freejoint/><geom type="box" size="0.2 0.1 0.05" mass="2"/>
<body name="arm" pos="0 0 0.1"><joint name="hinge" axis="0 1 0" range="-90 90"/><geom type="mesh" mesh="m" mass="0.5"/>
</body></body></worldbody><actuator><motor joint="hinge" gear="1" ctrlrange="-1 1"/></actuator></mujoco>
""",
    "r.urdf.xacro": """<robot name="cart" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:property name="r" value="0.1"/><xacro:arg name="mass" default="2.0"/>
<xacro:macro name="body" params="name mass:=1 *shape"><link name="${name}"><inertial><mass value="${mass}"/>
<inertia ixx="${0.4 * r**2}" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><xacro:insert_block name="shape"/></geometry></collision></link></xacro:macro>
<xacro:body name="base" mass="$(arg mass)"><box size="${2*r} 0.3 0.1"/></xacro:body>
<xacro:body name="wheel"><cylinder radius="${r}" length="0.05"/></xacro:body>
<xacro:if value="${r > 0}"><joint name="axle" type="continuous"><parent link="base"/><child link="wheel"/>
<axis xyz="0 1 0"/><limit effort="10" velocity="5"/></joint></xacro:if></robot>
""",
}


def model_case(chance: Chance) -> Case:
    """A model of URDF, xacro, SDF or MJCF."""
    name = chance.choice(("r.urdf", *_MODEL_TEXTS))
    text = robot_text(chance) if name == "r.urdf" else _MODEL_TEXTS[name]
    if chance.random() < 0.6:
        text = mutated(text, chance)
    data = text.encode("utf-8", "replace")
    data = damaged(data, chance) if chance.random() < 0.5 else data
    return Case("model", {SCENARIO: _with_model(name), name: data, MESH: MESH_TEXT.encode()}, name)


_MESHES: Final[Mapping[str, tuple[bytes, ...]]] = {
    "m.stl": (stl(), ascii_stl()),
    "m.obj": (obj(), two_objects(), obj(corner=lambda row: f"{row + 1}/1/1")),
    "m.dae": (dae(), two_instances()),
}
_URDF: Final = """<robot name="a"><link name="b"><inertial><mass value="1"/>
<inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><geometry><mesh filename="{0}"/></geometry></visual>
<collision><geometry><mesh filename="{0}"/></geometry></collision></link></robot>
"""


def mesh_case(chance: Chance) -> Case:
    """A mesh of a model, or of a body of the world."""
    name = chance.choice(sorted(_MESHES))
    data = damaged(chance.choice(_MESHES[name]), chance)
    if chance.random() < 0.5:
        more = {"mass": 1} if chance.random() < 0.5 else {}
        return Case("mesh", {SCENARIO: _with_world({"mesh": {"file": name}}, **more), name: data}, name)
    return Case("mesh", {SCENARIO: _with_model("r.urdf"), "r.urdf": _URDF.format(name).encode(), name: data}, name)


# Side files


_GREY: Final = np.arange(0, 240, 4).reshape(6, 10)
_TEXT_PGM: Final = b"P2\n# dark\n3 2\n255\n0 10 255\n255 255 0\n"
_IMAGES: Final[Mapping[str, tuple[bytes, ...]]] = {
    "m.pgm": (pgm(_GREY), pgm(_GREY * 200, 65_535), _TEXT_PGM),
    "m.png": (png(_GREY, kinds=(0, 1, 2, 3, 4)), png(_GREY * 200, 16)),
}


def map_case(chance: Chance) -> Case:
    """An occupancy map, or its image."""
    image = chance.choice(sorted(_IMAGES))
    said = f"image: {image}\nresolution: 0.05\norigin: [1.0, -2.0, 0.1]\nnegate: 0\n"
    said += "occupied_thresh: 0.65\nfree_thresh: 0.2\n"
    files = {"f.yaml": said.encode(), image: chance.choice(_IMAGES[image])}
    victim = chance.choice(("f.yaml", image))
    files[victim] = damaged(files[victim], chance)
    return Case("map", {SCENARIO: _with_world({"map": {"file": "f.yaml"}}), **files}, victim)


def heightfield_case(chance: Chance) -> Case:
    """An image of heights."""
    image = chance.choice(sorted(_IMAGES))
    shape = {"heightfield": {"image": image, "size": [2, 2], "height": 0.1}}
    return Case(
        "heightfield", {SCENARIO: _with_world(shape), image: damaged(chance.choice(_IMAGES[image]), chance)}, image
    )


_GOLDEN: Final = (
    b"# sim-action golden trajectory 1: turtlebot3_burger\ntime_s,x_m,y_m,z_m,yaw_rad\n"
    b"0.000,0.0000,0.0000,0.0102,0.0000\n0.050,0.0000,0.0000,0.0102,0.0000\n0.100,0.0000,0.0000,0.0102,0.0000\n"
)


def golden_case(chance: Chance) -> Case:
    """A golden trajectory."""
    expected = [{"matches": {"trace": "f.csv", "position": "1 m", "yaw": "1 rad"}}]
    return Case("golden", {SCENARIO: _scenario(expect=expected), "f.csv": damaged(_GOLDEN, chance)}, "f.csv")


def path_case(chance: Chance) -> Case:
    """The points of a path."""
    points = b"x,y\n0,0\n0.5,0\n1.0,0.25\n2.0, 1e0\n"
    expected = [{"follow_path": {"file": "f.csv", "max_error": "9 m", "smooth": chance.random() < 0.5}}]
    return Case("path", {SCENARIO: _scenario(expect=expected), "f.csv": damaged(points, chance)}, "f.csv")


_LOGS: Final = (
    b"time,linear,angular\n0.0,0.2,0\n0.05,0.1,0.5\n0.1,0,0\n",
    b'time,velocity.wheel_left_joint,"velocity.wheel_right_joint"\n1700000000.5,1,1\n1700000000.6,2,-1\n',
    b"linear,time,lateral\n1,0,0\n\n0,0.05,0\n",
)


def log_case(chance: Chance) -> Case:
    """A log of commands."""
    source = {"replay": "f.csv", "rate": "20 Hz"}
    return Case("log", {SCENARIO: _scenario(commands=source), "f.csv": damaged(chance.choice(_LOGS), chance)}, "f.csv")


_ANSWERS: Final = (
    '{"twist": {"linear": 0.2, "angular": 0, "lateral": 0}}',
    '{"velocity": {"wheel_left_joint": 1.5, "wheel_right_joint": -1e-3}, "max_effort": {"wheel_left_joint": 2}}',
    "{}",
    "null",
    '{"effort": {"wheel_left_joint": 0.1}, "twist": {}}',
    '{"wrenches": [{"link": "base_scan", "force": [0, 0, 1e1], "frame": "base"}, {"link": "base_footprint"}]}',
)
_PROGRAM: Final = b"""import sys
for answer in open("answers.txt", "rb").read().split(b"\\n"):
    if not sys.stdin.readline():
        break
    sys.stdout.buffer.write(answer + b"\\n")
    sys.stdout.flush()
"""


def process_case(chance: Chance) -> Case:
    """The lines that a program answers."""
    lines = [b"{}", *(_line(chance) for _ in range(3))]
    source = {"process": "python3 answer.py", "rate": "20 Hz"}
    files = {SCENARIO: _scenario(commands=source), "answer.py": _PROGRAM, ANSWERS: b"\n".join(lines)}
    return Case("process", files, ANSWERS)


def _line(chance: Chance) -> bytes:
    text = chance.choice(_ANSWERS)
    match chance.randrange(5):
        case 0:
            text = text.replace(chance.choice(("0.2", "0", "1.5", "null", "-1e-3")), chance.choice(NUMBERS))
        case 1:
            text = text.replace(
                chance.choice(("twist", "velocity", "linear", "wheel_left_joint")), chance.choice(TOKENS)
            )
        case 2:
            text = chance.choice(
                ("[" * 50_000, '{"a":' * 50_000, f"[{text}]", text * 2, text[:-1], f'"{text}"', "NaN", "true")
            )
        case 3:
            return damaged(text.encode(), chance).replace(b"\n", b" ")
    return text.encode()


KINDS: Final[Mapping[str, Callable[[Chance], Case]]] = {
    "scenario": scenario_case,
    "model": model_case,
    "mesh": mesh_case,
    "map": map_case,
    "heightfield": heightfield_case,
    "golden": golden_case,
    "path": path_case,
    "log": log_case,
    "process": process_case,
}
"""Kind -> function that makes a case."""
