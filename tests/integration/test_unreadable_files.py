"""A file that the system cannot read is an error of its scenario, with the name of the file and the system's reason."""

from __future__ import annotations

import builtins
import errno
import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import pytest

from sim_action.cli.main import call
from sim_action.results.results_json import Results
from tests.integration.hostile_files import BOX, MAP, PGM, SDF
from tests.integration.hostile_files import URDF as HOSTILE_URDF
from tests.mesh_files import dae, obj, stl

GOOD: Final = """\
name: good
robot: {model: turtlebot3_burger}
expect: [upright: {max_tilt: 20 deg}]
time_limit: 0.1 s
"""
URDF: Final = HOSTILE_URDF.replace("VISUAL", "").replace("<robot", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"')
MJCF: Final = """\
<mujoco><asset><mesh name="m" file="f.obj"/></asset>
<worldbody><body><freejoint/><geom type="SHAPE mass="1"/></body></worldbody></mujoco>
"""
GOLDEN: Final = (
    "# sim-action golden trajectory 1: turtlebot3_burger\ntime_s,x_m,y_m,z_m,yaw_rad\n0,0,0,0,0\n0.1,0,0,0,0\n"
)
CONTROLLER: Final = "def control(observation):\n    return None\n"
ASSERTION: Final = """\
from sim_action import Verdict


class Never:
    def judge(self, trace):
        return Verdict(True, 1.0, 1.0, 0.0, "m", 0.0, "never")
"""

Files = dict[str, str | bytes]


def scenario(**keys: str) -> str:
    robot, expect = "{model: turtlebot3_burger}", "[upright: {max_tilt: 20 deg}]"
    usual = {"name": "s", "robot": robot, "expect": expect, "time_limit": "0.1 s"}
    return "".join(f"{key}: {value}\n" for key, value in (usual | keys).items())


def model(name: str) -> str:
    return scenario(robot=f"{{model: {name}, allow: [unsupported-part], pose: {{z: 1}}}}", expect="[no_collision]",
                    world="{objects: [{name: far, box: [1, 1, 1], pose: {x: 9}}]}")  # fmt: skip


def world(shape: str) -> str:
    return scenario(world=f"{{objects: [{{name: w, {shape}, pose: {{x: 9}}}}]}}")


CASES: Final[dict[str, tuple[str, Files]]] = {
    "scenario": ("s.sim.yml", {}),
    "base": ("f.yml", {"s.sim.yml": "extends: f.yml\nname: s\n", "f.yml": scenario()}),
    "urdf": ("f.urdf", {"s.sim.yml": model("f.urdf"), "f.urdf": URDF.replace("SHAPE", BOX)}),
    "stl": ("f.stl", {"s.sim.yml": model("r.urdf"), "r.urdf": URDF.replace("SHAPE", '<mesh filename="f.stl"/>'),
                      "f.stl": stl()}),
    "dae": ("f.dae", {"s.sim.yml": model("r.urdf"), "r.urdf": URDF.replace("SHAPE", '<mesh filename="f.dae"/>'),
                      "f.dae": dae()}),
    "xacro": ("f.xacro", {"s.sim.yml": model("f.xacro"), "f.xacro": URDF.replace("SHAPE", BOX)}),
    "xacro include": ("g.xacro", {
        "s.sim.yml": model("f.xacro"),
        "f.xacro": URDF.replace("SHAPE", BOX).replace("<link", '<xacro:include filename="g.xacro"/><link', 1),
        "g.xacro": '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"/>'}),
    "sdf": ("f.sdf", {"s.sim.yml": model("f.sdf"), "f.sdf": SDF.replace("SHAPE", "<box><size>1 1 1</size></box>")}),
    "sdf include": ("f.sdf", {
        "s.sim.yml": model("r.sdf"),
        "r.sdf": '<sdf version="1.9"><model name="m"><include merge="true"><uri>f.sdf</uri></include></model></sdf>',
        "f.sdf": SDF.replace("SHAPE", "<box><size>1 1 1</size></box>")}),
    "sdf mesh": ("f.obj", {"s.sim.yml": model("r.sdf"), "f.obj": obj(),
                           "r.sdf": SDF.replace("SHAPE", "<mesh><uri>f.obj</uri></mesh>")}),
    "mjcf": ("f.xml", {"s.sim.yml": model("f.xml"), "f.obj": obj(), "f.xml": MJCF.replace("SHAPE", 'mesh" mesh="m"')}),
    "mjcf mesh": ("f.obj", {"s.sim.yml": model("r.xml"), "f.obj": obj(),
                            "r.xml": MJCF.replace("SHAPE", 'mesh" mesh="m"')}),
    "mjcf include": ("g.xml", {
        "s.sim.yml": model("r.xml"), "f.obj": obj(),
        "r.xml": MJCF.replace("SHAPE", 'mesh" mesh="m"').replace("<asset>", '<include file="g.xml"/><asset>'),
        "g.xml": "<mujoco><option/></mujoco>"}),
    "mesh": ("f.stl", {"s.sim.yml": world("mesh: {file: f.stl}"), "f.stl": stl()}),
    "heightfield": ("m.pgm", {"s.sim.yml": world("heightfield: {image: m.pgm, size: [1, 1], height: 0.1}"),
                              "m.pgm": PGM}),
    "map": ("f.yaml", {"s.sim.yml": world("map: {file: f.yaml}"), "f.yaml": MAP.replace("IMAGE", "m.pgm"),
                       "m.pgm": PGM}),
    "map image": ("m.pgm", {"s.sim.yml": world("map: {file: f.yaml}"), "f.yaml": MAP.replace("IMAGE", "m.pgm"),
                            "m.pgm": PGM}),
    "csv log": ("f.csv", {"s.sim.yml": scenario(commands="{replay: f.csv, rate: 10 Hz}"),
                          "f.csv": "time,linear\n0,0\n"}),
    "ros log": ("f.bag", {"s.sim.yml": scenario(commands="{replay: f.bag, topic: /cmd_vel, rate: 10 Hz}"),
                          "f.bag": b"#ROSBAG V2.0\n"}),
    "golden": ("f.csv", {"s.sim.yml": scenario(expect="[matches: {trace: f.csv, position: 1 m}]"), "f.csv": GOLDEN}),
    "path": ("f.csv", {"s.sim.yml": scenario(expect="[follow_path: {file: f.csv, max_error: 9 m}]"),
                       "f.csv": "x,y\n0,0\n0,1\n"}),
    "script": ("f.py", {"s.sim.yml": scenario(commands="{script: f.py, rate: 10 Hz}"), "f.py": CONTROLLER}),
    "assertion": ("f.py", {"s.sim.yml": scenario(expect="[assertion: 'f.py:Never']"), "f.py": ASSERTION}),
}  # fmt: skip
"""What is read -> the file that cannot be, and all files."""


READ_BY_CHILD: Final = ("csv log", "golden", "mjcf", "mjcf include", "mjcf mesh", "path", "ros log")  # once more


class Failing:
    """Makes opening or reading files of these names fail, in this process and in forks of it."""

    def __init__(self, names: frozenset[str], patch: pytest.MonkeyPatch, *, on_read: bool, only_below: bool) -> None:
        self.names, self.on_read, self.only_below = names, on_read, only_below
        self.process = os.getpid()
        self.open, self.fdopen, self.plain = os.open, os.fdopen, builtins.open
        self.chosen: set[int] = set()
        patch.setattr(os, "open", self._open)
        patch.setattr(os, "fdopen", self._fdopen)
        for module in (builtins, io):
            patch.setattr(module, "open", self._plain)

    def _fails(self, path: Any) -> bool:
        here = not self.only_below or os.getpid() != self.process
        return here and isinstance(path, (str, Path)) and Path(path).name in self.names

    def _open(self, path: Any, *rest: Any, **named: Any) -> int:
        if self._fails(path) and not self.on_read:
            raise OSError(errno.EIO, os.strerror(errno.EIO), str(path))
        descriptor = self.open(path, *rest, **named)
        (self.chosen.add if self._fails(path) else self.chosen.discard)(descriptor)
        return descriptor

    def _fdopen(self, descriptor: int, *rest: Any, **named: Any) -> Any:
        if descriptor in self.chosen:
            return Unreadable(self.fdopen(descriptor, *rest, **named).detach())
        return self.fdopen(descriptor, *rest, **named)

    def _plain(self, path: Any, mode: str = "r", *rest: Any, **named: Any) -> Any:
        if self._fails(path) and "r" in mode:
            raise OSError(errno.EIO, os.strerror(errno.EIO), str(path))
        return self.plain(path, mode, *rest, **named)


class Unreadable(io.BufferedReader):
    """A file on a broken disk: the system does not say its name."""

    def _fail(self, *_: object) -> Any:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    read = read1 = readinto = readline = readlines = peek = _fail


@pytest.mark.parametrize(
    ("cases", "only_below"), [([*CASES], False), (READ_BY_CHILD, True)], ids=["everywhere", "in children"]
)
@pytest.mark.parametrize("on_read", [False, True], ids=["opened", "read"])
def test_files_that_cannot_be_read_are_named_with_the_reason(
    cases: Sequence[str], on_read: bool, only_below: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    named = {name: f"{number}-{CASES[name][0]}" for number, name in enumerate(cases)}
    (tmp_path / "a.sim.yml").write_text(GOOD)
    for name, bad in named.items():
        usual, files = CASES[name]
        (tmp_path / name).mkdir()
        for file, text in ({"s.sim.yml": scenario()} | files).items():
            data = text if isinstance(text, bytes) else text.replace(usual, bad).encode()
            (tmp_path / name / file.replace(usual, bad)).write_bytes(data)
    monkeypatch.chdir(tmp_path)
    with pytest.MonkeyPatch.context() as patch:
        Failing(frozenset(named.values()), patch, on_read=on_read, only_below=only_below)
        assert call(["run", ".", "-q", "--jobs", "1", "--no-report"]) in (1, 2)
    outcomes = {
        Path(each.file).parent.name: each for each in Results.read(tmp_path / "sim-results/results.json").outcomes
    }
    assert outcomes.pop("").status == "passed"
    assert outcomes.keys() == named.keys()
    for name, outcome in outcomes.items():
        (failure,) = outcome.failures
        assert outcome.status == "error"
        assert failure.kind != "internal"
        shown = f"{failure.location}: {failure.message}"
        assert named[name] in shown
        assert "Input/output error" in shown
