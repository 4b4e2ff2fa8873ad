"""Files that are too much, and calls with many runs: each is an error with its cause, and costs little."""

from __future__ import annotations

import struct
import sys
import zlib
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Final

import junitparser
import pytest

from sim_action.engines import installed
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from tests.integration.conftest import peak_kb
from tests.soak import soaked

MOST_MEGABYTES: Final = 190
"""Of the caller, at its peak: 55 MB are its own, the largest of these files, of 107 MB, may be in memory once."""

SCENARIO: Final = """\
name: {name}
robot: {{model: {model}}}
physics: {{settle: 0}}
expect: [upright]
time_limit: 0.1 s
"""

INERTIAL: Final = (
    '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    '<collision><geometry><sphere radius="1"/></geometry></collision>'
)
TETRAHEDRON: Final = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
FACES: Final = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
TEXTURED: Final = (
    '<visual><geometry><box size="1 1 1"/></geometry><material name="m"><texture filename="i.png"/></material></visual>'
)
TRIANGLES: Final = 1_000_000
BINARY_TRIANGLES: Final = 2_150_000
SIDE: Final = 20_000


def robot(links: str) -> bytes:
    return f'<robot name="r">\n{links}</robot>\n'.encode()


def body(part: str) -> bytes:
    return robot(f'<link name="base">{INERTIAL}{part}</link>\n')


def shape(tag: str, mesh: str) -> bytes:
    return body(f'<{tag}><geometry><mesh filename="{mesh}"/></geometry></{tag}>')


def chain(count: int) -> bytes:
    links = "".join(f'<link name="l{number}">{INERTIAL}</link>\n' for number in range(count))
    joints = "".join(
        f'<joint name="j{number}" type="fixed"><parent link="l{number}"/><child link="l{number + 1}"/></joint>\n'
        for number in range(count - 1)
    )
    return robot(links + joints)


def stl() -> bytes:
    return bytes(80) + struct.pack("<I", BINARY_TRIANGLES) + bytes(50 * BINARY_TRIANGLES)


def obj() -> bytes:
    return (TETRAHEDRON + FACES * (TRIANGLES // 4)).encode()


@cache
def image() -> bytes:
    """A black PNG that takes 1.2 GB when it is unpacked."""
    packer = zlib.compressobj(1)
    # A block for each row, all alike but for the first; to pack them all would take a second.
    first, *_, other = (packer.compress(bytes(3 * SIDE + 1)) + packer.flush(zlib.Z_FULL_FLUSH) for _ in range(3))
    checksum = (3 * SIDE + 1) * SIDE % 65521 << 16 | 1
    packed = first + other * (SIDE - 1) + b"\x03\x00" + struct.pack(">I", checksum)
    chunks = ((b"IHDR", struct.pack(">IIBBBBB", SIDE, SIDE, 8, 2, 0, 0, 0)), (b"IDAT", packed), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)) for name, data in chunks
    )


Files = Callable[[], dict[str, bytes]]

# What there is beside the model -> the cause, if it is refused.
CASES: Final[dict[str, tuple[Files, str]]] = {
    "a mesh of two million triangles, STL": (
        lambda: {"robot.urdf": shape("collision", "mesh.stl"), "mesh.stl": stl()},
        "robot.urdf:2: mesh 'mesh.stl': has 2,150,000 triangles or more; at most 2,100,000 are read",
    ),
    "a mesh of a million triangles, OBJ": (
        lambda: {"robot.urdf": shape("collision", "mesh.obj"), "mesh.obj": obj()},
        "robot.urdf:2: mesh 'mesh.obj': has 500,001 triangles or more; at most 500,000 are read",
    ),
    "a chain of 3,000 links": (lambda: {"robot.urdf": chain(3000)}, "2999 joints; at most 1000 are supported"),
    "a model of 100,000 links": (lambda: {"robot.urdf": chain(100_000)}, "a model may have at most 20 MB"),
    "a model of 100,000 links that say little": (
        lambda: {"robot.urdf": robot('<link name="l"/>\n' * 100_000)},
        "robot.urdf:50001: more than 50,000 elements [bad-xml]",
    ),
    "a model of 25 MB": (lambda: {"robot.urdf": body("") + b" " * 25_000_000}, "a model may have at most 20 MB"),
    "a model of 19 MB of small elements": (
        lambda: {"robot.urdf": body("<a/>" * 4_700_000)},
        "robot.urdf:2: more than 50,000 elements [bad-xml]",
    ),
    "an image as a model": (
        lambda: {"robot.urdf": image()},
        "robot.urdf:1: not well-formed XML: not well-formed (invalid token); the file is not text",
    ),
    "an image as a mesh": (
        lambda: {"robot.urdf": shape("collision", "image.png"), "image.png": image()},
        "robot.urdf:2: mesh 'image.png': '.png' files are not supported",
    ),
    "an image as a mesh, by another name": (
        lambda: {"robot.urdf": shape("collision", "image.stl"), "image.stl": image()},
        "robot.urdf:2: mesh 'image.stl': is not an STL file, or was cut off",
    ),
    # Nothing is drawn, so that nobody opens these.
    "an image of a texture": (lambda: {"robot.urdf": body(TEXTURED), "i.png": image()}, ""),
    "an image of a visual": (lambda: {"robot.urdf": shape("visual", "i.png"), "i.png": image()}, ""),
    "a material of a mesh": (
        lambda: {
            "robot.urdf": shape("collision", "mesh.obj"),
            "mesh.obj": f"mtllib mesh.mtl\nusemtl m\n{TETRAHEDRON}{FACES}".encode(),
            "mesh.mtl": b"newmtl m\nmap_Kd i.png\n",
            "i.png": image(),
        },
        "",
    ),
}


def run_suite(folder: Path, suite: Mapping[str, Files]) -> tuple[dict[str, Outcome], Path]:
    """The outcomes of a scenario for each name, in a folder of its own, and of an honest one; the JUnit file."""
    for name, files in suite.items():
        (folder / name).mkdir()
        for file, data in files().items():
            (folder / name / file).write_bytes(data)
        (folder / name / "a.sim.yml").write_text(SCENARIO.format(name=f'"{name}"', model="robot.urdf"))
    (folder / "z.sim.yml").write_text(SCENARIO.format(name="honest", model="turtlebot3_burger"))
    _, peak = peak_kb(folder, "run", ".", "--jobs", "2")
    assert peak / 1024 < MOST_MEGABYTES
    outcomes = Results.read(folder / "sim-results/results.json").outcomes
    return {outcome.name: outcome for outcome in outcomes}, folder / "sim-results/junit.xml"


SOME: Final = tuple(name for name in CASES if not name.startswith(("an image", "a model of 1")))


@pytest.mark.parametrize("names", soaked([[*SOME], *([name] for name in CASES)], short=[[*SOME]]))
def test_what_is_too_much_is_an_error_with_its_cause(names: list[str], tmp_path: Path) -> None:
    outcomes, junit_file = run_suite(tmp_path, {name: CASES[name][0] for name in names})
    assert outcomes.pop("honest").status == "passed"
    assert outcomes.keys() == set(names)
    refused = [name for name in names if CASES[name][1]]
    assert [name for name in names if outcomes[name].status == "error"] == refused
    for name in refused:
        (failure,) = outcomes[name].failures
        assert CASES[name][1] in f"{failure.location}: {failure.message}".removeprefix(f"{name}/")
    junit = junitparser.JUnitXml.fromfile(str(junit_file))
    assert (junit.tests, junit.errors, junit.failures) == (len(names) + 1, len(refused), 0)


on_linux = pytest.mark.skipif(sys.platform != "linux", reason="other systems tell no peak of memory in this way")
FEW: Final = 20
MOST_KB_FOR_A_RUN: Final = 45
"""Of the caller: 7 kB for its plan and outcome, the rest for its place in `report.html`, which has 2,000 at most. 31 to
36 kB were measured."""

MOST_MB: Final = 200  # of the caller, with 10,000 runs and all reports
VARIED: Final = """\
name: drive
robot: {{model: turtlebot3_burger}}
commands: {{rate: 10 Hz, twist: [{{linear: 1.0}}]}}
expect: [{{travel: {{at_least: 1 mm}}}}, {{upright: {{max_tilt: 10 deg}}}}]
duration: 0.2 s
time_limit: 0.2 s
backend: {engine}
variations: {{robot.pose.yaw: {{uniform: [-1 deg, 1 deg], samples: {samples}}}}}
"""


def peak_of(folder: Path, samples: int) -> int:
    """The largest memory of the caller, in kB."""
    folder.mkdir()
    engine = "mujoco" if "mujoco" in installed() else installed()[0]
    (folder / "drive.sim.yml").write_text(VARIED.format(engine=engine, samples=samples))
    code, peak = peak_kb(folder, "run", "drive.sim.yml", "--quiet")
    outcomes = Results.read(folder / "sim-results/results.json").outcomes if samples < 1_000 else ()
    assert (code, [outcome.status for outcome in outcomes]) in ((0, []), (0, ["passed"] * samples))
    return peak


@on_linux
@pytest.mark.soak
@pytest.mark.parametrize("samples", [200, 10_000])
def test_a_call_keeps_little_of_each_run(tmp_path: Path, samples: int) -> None:
    few, many = peak_of(tmp_path / "few", FEW), peak_of(tmp_path / "many", samples)
    assert many - few < MOST_KB_FOR_A_RUN * (samples - FEW)
    assert many * 1_024 < MOST_MB * 1_000_000
