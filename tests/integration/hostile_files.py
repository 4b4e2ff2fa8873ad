"""Scenarios and models that name files outside the workspace, files that are none, and more than a memory holds.

In each text, OUT is the folder outside the workspace, as an absolute path, and UP is the same, relative to the case.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from tests.mesh_files import dae, obj, stl

SENTINEL: Final = "sentinel-of-the-test"  # a word in each text outside the workspace, and in .git
Content = str | bytes
Files = Mapping[str, Content]


@dataclass(frozen=True)
class Case:
    """A scenario in a folder of its own."""

    name: str
    message: str  # a part of the message of its error; empty: it passes, because the file is ignored
    place: str  # the file and line of the error, such as "r.xml:2"
    files: Files = field(default_factory=dict)  # name -> content
    links: Mapping[str, str] = field(default_factory=dict)  # name -> target of a link
    pipes: tuple[str, ...] = ()  # names of pipes
    scenario: Mapping[str, object] = field(default_factory=dict)  # keys of the scenario, as JSON values
    folders: tuple[str, ...] = ()

    @property
    def folder(self) -> str:
        return self.name.replace(" ", "_").replace("/", "_")


BODY: Final = '<worldbody><body name="b"><freejoint/><geom size=".1"/></body></worldbody>'
URDF: Final = """\
<robot name="a"><link name="b">
  <inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry>SHAPE</geometry></collision>VISUAL
</link></robot>
"""
BOX: Final = '<box size="1 1 1"/>'
SDF: Final = """\
<sdf version="1.9"><model name="a"><link name="b">
<inertial><mass>1</mass></inertial><collision name="c">
<geometry>SHAPE</geometry></collision></link></model></sdf>
"""
INCLUDING: Final = """\
<sdf version="1.9"><model name="m">
<include merge="true"><uri>URI</uri></include></model></sdf>
"""
XXE: Final = '<!DOCTYPE x [<!ENTITY e SYSTEM "file://OUT/secret.txt">]>\n'
METADATA: Final = "rosbag2_bagfile_information: {version: 5, relative_file_paths: [b.db3]}\n"
PGM: Final = b"P5 2 2 255\n\0\xff\xff\xff"
MAP: Final = "image: IMAGE\nresolution: 0.1\norigin: [5, 5, 0]\n"
OUTSIDE: Final = "is outside the workspace"
NOT_A_FILE: Final = "is not a regular file"


def mjcf(name: str, asset: str, message: str = OUTSIDE, place: str = "r.xml:2", **more: Any) -> Case:
    """Return a case with an MJCF model; `asset`: its assets, which begin in line 2."""
    files = {"r.xml": f"<mujoco><asset>\n{asset}</asset>{BODY}</mujoco>", **more.pop("files", {})}
    return Case(f"mjcf {name}", message, place, files, scenario=robot("r.xml"), **more)


def urdf(name: str, shape: str, message: str = OUTSIDE, place: str = "r.urdf:3", **more: Any) -> Case:
    """Return a case with a URDF whose collision shape is `shape`, in line 3."""
    text = URDF.replace("SHAPE", shape).replace("VISUAL", more.pop("visual", ""))
    files = {"r.urdf": text, **more.pop("files", {})}
    return Case(f"urdf {name}", message, place, files, scenario=robot("r.urdf"), **more)


def sdf(name: str, text: str, message: str = OUTSIDE, place: str = "r.sdf:3", **more: Any) -> Case:
    """Return a case with an SDF model."""
    return Case(f"sdf {name}", message, place, {"r.sdf": text}, scenario=robot("r.sdf"), **more)


def world(name: str, shape: Mapping[str, object], message: str = OUTSIDE, **more: Any) -> Case:
    """Return a case with a body of the world, in line 6."""
    objects = {"world": {"objects": [{"name": "w", **shape, "pose": {"x": 9}}]}}
    return Case(f"world {name}", message, "s.sim.yml:6", scenario=objects, **more)


def robot(model: str, **more: object) -> dict[str, object]:
    return {"robot": {"model": model, "pose": {"z": 1}, "allow": ["unsupported-part"], **more}}


def mesh(reference: str) -> str:
    return f'<mesh filename="{reference}"/>'


MJCF_CASES: Final = (
    mjcf("include absolute", '<include file="OUT/secret.xml"/>'),
    mjcf("include above", '<include file="UP/secret.xml"/>'),
    mjcf("include of an include", '<include file="a.xml"/>', place="a.xml:2",
         files={"a.xml": '<x>\n<include file="OUT/secret.xml"/></x>'}),
    mjcf("include by a link", '<include file="a.xml"/>', links={"a.xml": "OUT/secret.xml"}),
    mjcf("include of a pipe", '<include file="a.xml"/>', NOT_A_FILE, pipes=("a.xml",)),
    mjcf("include of a DTD", '<include file="a.xml"/>', "a DOCTYPE is not allowed", "a.xml:1",
         files={"a.xml": XXE + "<x>&e;</x>"}),
    mjcf("model absolute", '<model name="m" file="OUT/secret.xml"/>'),
    mjcf("model above", '<model name="m" file="UP/secret.xml"/>'),
    mjcf("model of a model", '<model name="m" file="a.xml"/>', place="a.xml:2",
         files={"a.xml": f'<mujoco><asset>\n<model file="OUT/secret.xml"/></asset>{BODY}</mujoco>'}),
    mjcf("mesh of a model", '<model name="m" file="a.xml"/>', place="a.xml:2",
         files={"a.xml": f'<mujoco><compiler meshdir="OUT"/><asset>\n<mesh file="secret.stl"/></asset>{BODY}</mujoco>',
                }),
    mjcf("mesh absolute", '<mesh file="OUT/secret.stl"/>'),
    mjcf("mesh above", '<mesh file="UP/secret.obj"/>'),
    mjcf("mesh by a link", '<mesh file="m.stl"/>', links={"m.stl": "OUT/secret.stl"}),
    mjcf("mesh by a link to a folder", '<mesh file="m/secret.stl"/>', links={"m": "OUT"}),
    mjcf("mesh by a relative link", '<mesh file="m.stl"/>', links={"m.stl": "UP/secret.stl"}),
    mjcf("mesh by an address", '<mesh file="file://OUT/secret.stl"/>', "does not exist"),
    mjcf("mesh with backslashes", r'<mesh file="..\..\outside\secret.stl"/>', "does not exist"),
    mjcf("mesh in a folder outside", '</asset><compiler meshdir="OUT"/><asset>\n<mesh file="secret.stl"/>',
         place="r.xml:3"),
    mjcf("mesh in a folder above", '</asset><compiler assetdir="UP"/><asset><mesh file="secret.stl"/>'),
    mjcf("mesh in a folder by a link", '</asset><compiler meshdir="m"/><asset><mesh file="secret.stl"/>',
         links={"m": "OUT"}),
    mjcf("mesh of a class", '</asset><default><mesh file="OUT/secret.stl"/></default><asset>'),
    mjcf("mesh is a folder", '<mesh file="m.stl"/>', "is a folder", folders=("m.stl",)),
    mjcf("mesh is a pipe", '<mesh file="m.stl"/>', NOT_A_FILE, pipes=("m.stl",)),
    mjcf("mesh is a device", '<mesh file="m.stl"/>', links={"m.stl": "/dev/zero"}),
    mjcf("mesh is the environment", '<mesh file="m.obj"/>', links={"m.obj": "/proc/self/environ"}),
    mjcf("mesh is a token", '<mesh file="../.git/config"/>', "is in the folder .git"),
    mjcf("texture", '<texture type="2d" file="OUT/secret.png"/>'),
    mjcf("texture of a side", '<texture name="t" type="cube" fileup="UP/secret.png"/>'),
    mjcf("texture in a folder", '</asset><compiler texturedir="OUT"/><asset><texture type="2d" file="secret.png"/>'),
    mjcf("heightfield", '<hfield name="h" file="OUT/secret.png" size="1 1 1 1"/>'),
    mjcf("skin", '<skin name="s" file="OUT/secret.skn"/>'),
    mjcf("deformable skin", '</asset><deformable><skin name="s" file="OUT/secret.skn"/></deformable><asset>'),
    mjcf("flexcomp", '</asset><worldbody><flexcomp name="f" type="mesh" file="OUT/secret.obj"/></worldbody><asset>',
         "<flexcomp> is not simulated"),
    mjcf("plugin", '</asset><extension><plugin plugin="OUT/secret.so"/></extension><asset>',
         "<plugin> is not simulated"),
    mjcf("material file", '<material name="m" file="OUT/secret.png"/>', "<material file> may not name a file"),
    mjcf("much memory", '</asset><size memory="100G"/><asset>', "this is too much memory"),
    mjcf("many copies", '</asset><worldbody><replicate count="40000"><site/><site/></replicate></worldbody><asset>',
         "makes 80,000 elements"),
    mjcf("a large texture", '<texture name="t" builtin="flat" type="2d" width="100000" height="100000"/>',
         "<texture width='100000'>"),
    mjcf("a large heightfield", '<hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/>',
         "<hfield nrow='100000'>"),
)  # fmt: skip

URDF_CASES: Final = (
    urdf("mesh absolute", mesh("OUT/secret.stl")),
    urdf("mesh above", mesh("UP/secret.obj")),
    urdf("mesh by an address", mesh("file://OUT/secret.stl")),
    urdf("mesh of a package", mesh("package://p/UP/../outside/secret.stl"),
         files={"package.xml": "<package><name>p</name></package>"}),
    urdf("files of a package", BOX, "", "", files={"package.xml": "<package><name>watched</name></package>"}, visual=(
         '</link><gazebo><plugin name="gz_ros2_control-system" filename="libgz_ros2_control-system.so">'
         "<parameters>$(find watched)/UP/secret.yaml</parameters>"
         "<parameters>$(find watched)/../.git/c.yaml</parameters>"
         '<x filename="$(find watched)/UP/secret.xml"/><y file="$(find watched)/UP/secret.obj"/>'
         '<z uri="$(find watched)/../.git/config.xml"/></plugin></gazebo>'
         '<joint name="j" type="fixed"><parent link="b"/><child link="c"/></joint><link name="c">')),
    urdf("mesh of a package by a link", mesh("package://linked/m.stl"),
         "refers to the package 'linked', which was not found", links={"package.xml": "OUT/secret.package.xml"}),
    urdf("mesh by a link", mesh("m.stl"), links={"m.stl": "OUT/secret.stl"}),
    urdf("mesh by a link to a folder", mesh("m/secret.dae"), links={"m": "OUT"}),
    urdf("mesh is a pipe", mesh("m.stl"), NOT_A_FILE, pipes=("m.stl",)),
    urdf("mesh is a device", mesh("m.stl"), links={"m.stl": "/dev/zero"}),
    urdf("mesh is the environment", mesh("m.obj"), links={"m.obj": "/proc/self/environ"}),
    urdf("mesh is a folder", mesh("m.stl"), "is a folder", folders=("m.stl",)),
    urdf("mesh is a token", mesh("../.git/config"), "is in the folder .git"),
    urdf("visual mesh", BOX, visual=f"\n<visual><geometry>{mesh('OUT/secret.stl')}</geometry></visual>",
         place="r.urdf:4"),
    urdf("material of an OBJ", mesh("m.obj"), "", "",
         files={"m.obj": b"mtllib OUT/secret.mtl\nmtllib UP/secret.mtl\nusemtl m\n" + obj()}),
    urdf("image of a COLLADA file", mesh("m.dae"), "", "", files={"m.dae": dae().replace(
        b"<library_geometries>",
        b'<library_images><image id="i"><init_from>file://OUT/secret.png</init_from></image></library_images>'
        b"<library_geometries>")}),
    urdf("DTD of a COLLADA file", mesh("m.dae"), "DOCTYPE",
         files={"m.dae": XXE.encode() + b"<COLLADA>&e;</COLLADA>"}),
    urdf("texture of a material", BOX, "", "", visual=f'<visual><geometry>{BOX}</geometry><material name="m">'
         '<texture filename="OUT/secret.png"/></material></visual>'),
    Case("urdf DTD", "a DOCTYPE is not allowed", "r.urdf:1",
         {"r.urdf": XXE + URDF.replace("SHAPE", BOX).replace("VISUAL", "&e;")}, scenario=robot("r.urdf")),
    Case("urdf packages outside", OUTSIDE, "s.sim.yml:3", {"r.urdf": URDF.replace("SHAPE", mesh("package://q/secret.stl"))},
         scenario=robot("r.urdf", packages={"q": "UP"})),
    Case("model absolute", OUTSIDE, "s.sim.yml:3", scenario=robot("OUT/secret.urdf")),
    Case("model by a link", OUTSIDE, "s.sim.yml:3", links={"r.xml": "OUT/secret.xml"}, scenario=robot("r.xml")),
    Case("model is the environment", OUTSIDE, "s.sim.yml:3", scenario=robot("/proc/self/environ")),
    Case("model is a pipe", NOT_A_FILE, "s.sim.yml:3", pipes=("r.urdf",), scenario=robot("r.urdf")),
    Case("model is a xacro file", "scripts are not run on pull_request_target", "s.sim.yml:3",
         {"r.xacro": '<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro">${load_yaml("OUT/secret.yaml")}</robot>'},
         scenario=robot("r.xacro")),
)  # fmt: skip

SDF_CASES: Final = (
    sdf("include absolute", INCLUDING.replace("URI", "OUT/secret.sdf"), place="r.sdf:2"),
    sdf("include by an address", INCLUDING.replace("URI", "file://OUT/secret.sdf"), place="r.sdf:2"),
    sdf("include of a model", INCLUDING.replace("URI", "model://UP/secret.sdf"), "was not found", place="r.sdf:2"),
    sdf("include by a link", INCLUDING.replace("URI", "a.sdf"), place="r.sdf:2", links={"a.sdf": "OUT/secret.sdf"}),
    sdf("mesh", SDF.replace("SHAPE", "<mesh><uri>OUT/secret.stl</uri></mesh>")),
    sdf("mesh by a link", SDF.replace("SHAPE", "<mesh><uri>m.stl</uri></mesh>"), links={"m.stl": "OUT/secret.stl"}),
    Case("sdf manifest", OUTSIDE, "s.sim.yml:3",
         {"m/model.config": '<model><sdf version="1.9">../UP/secret.sdf</sdf></model>'}, scenario=robot("./m")),
    Case("sdf manifest by a link", "<sdf> has no attribute 'version'", "m/model.sdf:1", {"m/model.sdf": "<sdf/>"},
         links={"m/model.config": "OUT/secret.config"}, scenario=robot("./m")),
    sdf("files of a package", SDF.replace("SHAPE", "<box><size>1 1 1</size></box>").replace("</model>",
        "<plugin name='p' filename='libx.so'><uri>$(find watched)/UP/secret.xml</uri></plugin></model>"), "", ""),
    Case("sdf folder with links", "", "",
         {"m/model.sdf": SDF.replace("SHAPE", "<box><size>1 1 1</size></box>")},
         links={"m/x.sdf": "OUT/secret.sdf", "m/y.config": "OUT/secret.config"}, scenario=robot("./m")),
    sdf("DTD", XXE + SDF, "a DOCTYPE is not allowed", "r.sdf:1"),
)  # fmt: skip

WORLD_CASES: Final = (
    world("mesh", {"mesh": {"file": "OUT/secret.stl"}}),
    world("mesh by a link", {"mesh": {"file": "m.stl"}}, links={"m.stl": "OUT/secret.stl"}),
    world("heightfield", {"heightfield": {"image": "UP/secret.pgm", "size": [1, 1], "height": 0.1}}),
    world("heightfield is a pipe", {"heightfield": {"image": "m.pgm", "size": [1, 1], "height": 0.1}}, NOT_A_FILE,
          pipes=("m.pgm",)),
    world("map", {"map": {"file": "OUT/secret.yaml"}}),
    world("image of a map", {"map": {"file": "m.yaml"}}, files={"m.yaml": MAP.replace("IMAGE", "OUT/secret.pgm")}),
    world("map is a token", {"map": {"file": "../.git/config"}}, "is in the folder .git"),
    Case("log", OUTSIDE, "s.sim.yml:6", scenario={"commands": {"replay": "OUT/secret.csv", "rate": "10 Hz"}}),
    Case("log is a token", "is in the folder .git", "s.sim.yml:6",
         scenario={"commands": {"replay": "../.git/config", "rate": "10 Hz"}}),
    Case("log in a folder", OUTSIDE, "s.sim.yml:6", {"bag/metadata.yaml": METADATA},
         links={"bag/b.db3": "OUT/secret.csv"},
         scenario={"commands": {"replay": "bag", "topic": "/cmd_vel", "rate": "10 Hz"}}),
    Case("log in a folder by a link", OUTSIDE, "s.sim.yml:6", links={"bag": "OUT"},
         scenario={"commands": {"replay": "bag", "topic": "/cmd_vel", "rate": "10 Hz"}}),
    Case("nodes of linked packages", "scripts are not run on pull_request_target", "s.sim.yml:6", {"q/n.py": ""},
         links={"p/package.xml": "OUT/secret.package.xml", "q/package.xml": "OUT/secret.package.xml",
                "q/a.launch": "OUT/secret.xml"},
         scenario={"commands": {"ros1": {"launch": ["q", "a.launch"]}, "rate": "10 Hz"}}),
    Case("package of nodes is a pipe", "scripts are not run on pull_request_target", "s.sim.yml:6", {"q/n.py": ""},
         pipes=("q/package.xml",), scenario={"commands": {"ros1": {"nodes": ["q/n.py"]}, "rate": "10 Hz"}}),
    Case("script", "scripts are not run on pull_request_target", "s.sim.yml:6",
         {"c.py": "def control(observation):\n    open('OUT/secret.txt').read()\n"},
         scenario={"commands": {"script": "c.py", "rate": "10 Hz"}}),
    Case("golden trajectory", OUTSIDE, "s.sim.yml:4",
         scenario={"expect": [{"matches": {"trace": "OUT/secret.csv", "position": "1 m"}}]}),
    Case("path", OUTSIDE, "s.sim.yml:4",
         scenario={"expect": [{"follow_path": {"file": "UP/secret.csv", "max_error": "9 m"}}]}),
    Case("base file", OUTSIDE, "s.sim.yml:6", scenario={"extends": "OUT/secret.yml"}),
)  # fmt: skip

CASES: Final = (*MJCF_CASES, *URDF_CASES, *SDF_CASES, *WORLD_CASES)

NORMAL: Final = (
    mjcf("normal", '<include file="p/a.xml"/><mesh file="m.obj"/><mesh file="p/n.stl"/><texture file="absent.png"/>'
         '<model name="m" file="p/m.xml"/>', "", "",
         files={"m.obj": obj(), "p/n.stl": stl(), "p/a.xml": '<x><mesh name="k" file="n.stl"/></x>',
                "p/m.xml": '<mujoco><asset><mesh file="n.stl"/></asset><worldbody><body name="h">'
                           '<geom type="mesh" mesh="n"/></body></worldbody></mujoco>'}),
    *(urdf(f"normal {kind}", mesh(f"m.{kind}"), "", "", files={f"m.{kind}": data})
      for kind, data in {"stl": stl(), "obj": obj(), "dae": dae()}.items()),
    sdf("normal", SDF.replace("SHAPE", "<box><size>1 1 1</size></box>"), "", ""),
    world("normal", {"map": {"file": "m.yaml"}}, "", files={"m.yaml": MAP.replace("IMAGE", "m.pgm"), "m.pgm": PGM}),
    Case("normal log", "", "", {"f.csv": "time,linear\n0,0\n"},
         scenario={"commands": {"replay": "f.csv", "rate": "10 Hz"}}),
)  # fmt: skip

SECRETS: Final[Files] = MappingProxyType(
    {
        "secret.xml": f"<mujoco model='{SENTINEL}'>{BODY}</mujoco>",
        "secret.urdf": URDF.replace("SHAPE", BOX).replace("VISUAL", "").replace('name="a"', f'name="{SENTINEL}"'),
        "secret.sdf": SDF.replace("SHAPE", "<box><size>1 1 1</size></box>"),
        "secret.stl": stl(),
        "secret.obj": obj(),
        "secret.dae": dae(),
        "secret.config": '<model><sdf version="1.9">model.sdf</sdf></model>',
        "secret.package.xml": "<package><name>linked</name></package>",
        "secret.mtl": f"newmtl {SENTINEL}\n",
        "secret.png": SENTINEL,
        "secret.skn": SENTINEL,
        "secret.so": SENTINEL,
        "secret.txt": SENTINEL,
        "secret.pgm": PGM,
        "secret.yaml": f"{SENTINEL}: 1\n",
        "secret.yml": f"name: {SENTINEL}\n",
        "secret.csv": f"{SENTINEL},linear\n0,0\n",
    }
)
"""The files outside the workspace. A model that could use one would load."""


def write_cases(root: Path, cases: tuple[Case, ...]) -> Path:
    """Write cases below `root`/workspace, and the secrets into `root`/outside; return the workspace."""
    workspace, outside = root / "workspace", root / "outside"
    for folder in (workspace / ".git", outside):
        folder.mkdir(parents=True)
    (workspace / ".git/config").write_text(f"[http]\n\textraheader = {SENTINEL}\n")
    (workspace / ".git/config.xml").write_text(f"<x>{SENTINEL}</x>")
    (workspace / ".git/c.yaml").write_text(f"{SENTINEL}: 1\n")
    for name, content in SECRETS.items():
        _write(outside / name, content, outside)
    for case in cases:
        folder = workspace / case.folder
        folder.mkdir()
        for name, content in {**case.files, "s.sim.yml": scenario(case)}.items():
            _write(folder / name, content, outside)
        for name, target in case.links.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).symlink_to(_filled(target, outside))
        for name in case.pipes:
            os.mkfifo(folder / name)
        for name in case.folders:
            (folder / name).mkdir()
    (workspace / "linked.sim.yml").symlink_to(outside / "secret.yml")
    return workspace


def scenario(case: Case) -> str:
    """Return the scenario of a case: each key on a line of its own, after a first line for each of the usual ones."""
    usual = {"name": case.name, "robot": {"model": "turtlebot3_burger"}, "expect": ["no_collision"]}
    keys = {**usual, "time_limit": "0.1 s", **case.scenario}
    return "{\n" + ",\n".join(f'"{key}": {json.dumps(value)}' for key, value in keys.items()) + "}\n"


def _write(path: Path, content: Content, outside: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(content, bytes) and b"OUT" not in content:
        path.write_bytes(content)
    else:
        path.write_text(_filled(content, outside))


def _filled(content: Content, outside: Path) -> str:
    text = content.decode() if isinstance(content, bytes) else content
    return text.replace("OUT", str(outside)).replace("UP", "../../outside")
