"""Scenarios on both engines: names, reports, which one ran, and how far they are apart at every step of any run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sim_action.engines import ENGINES, installed, named_version
from sim_action.state.trace_storage import load_trace
from tests.integration.conftest import fresh_sim_action, outcomes, sim_action
from tests.integration.engines import BALL
from tests.physics.robots import inertial, joint, link, robot
from tests.scenarios import LEAST, driving
from tests.soak import soaked

ENGINE_NAMES = tuple(ENGINES)
for _engine in ENGINE_NAMES:
    pytest.importorskip(_engine, reason=f"it takes two engines, and {_engine} is not installed")
# It is in the air for 0.32 s: the engines differ in the few steps in which it hits the ground.
DROP = """\
name: drop
robot: {model: ball.urdf, pose: {z: 0.6}}
physics: {settle: 0 s}
expect: [{upright: {max_tilt: 170 deg}}]
duration: 1 s
time_limit: 1 s
"""
# A swinging arm on a rail, each link with its inertia.
RAIL = 'lower="-1" upper="1" effort="100" velocity="10"'
ARM = robot(
    link("post", ""),
    link("slider", inertial(1.0, (0.01, 0.01, 0.01))),
    link("fork", inertial(1.0, (0.01, 0.01, 0.01), (0.3, 0.0, 0.0))),
    link("tip", ""),
    joint("rail", "prismatic", "post", "slider", axis=(1.0, 0.0, 0.0), limit=RAIL),
    joint("swing", "continuous", "slider", "fork"),
    joint("mount", "fixed", "fork", "tip", (0.6, 0.0, 0.0)),
)
SWINGS = """\
name: swings
robot: {model: MODEL, base: fixed, pose: {z: 2}, joints: {swing: 10 deg}}
physics: {settle: 0 s}
expect: [{joint: {name: swing, at_most: 360 deg}}]
duration: 1 s
time_limit: 1 s
"""


def run(folder: Path, text: str, *flags: str) -> tuple[int, list[dict[str, Any]]]:
    """Exit code and outcomes."""
    (folder / "ball.urdf").write_text(BALL)
    (folder / "arm.urdf").write_text(ARM)
    xacro = ARM.replace("<robot", '<robot xmlns:xacro="http://ros.org/wiki/xacro"')
    (folder / "arm.urdf.xacro").write_text(xacro)
    (folder / "a.sim.yml").write_text(text)
    return sim_action(folder, "run", *flags).returncode, outcomes(folder)


def compared(outcome: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The verdicts of an agreement by their names, without the engine."""
    compared = [expected for expected in outcome["expectations"] if expected["assertion"] == "agreement"]
    return {expected["name"].removesuffix(" as pybullet 3.2.7"): expected["verdict"] for expected in compared}


FLAGS = [(), ("--no-report",), ("--repeat", "2")]
RATES = (1, 10, 240)
SHORT = [((), RATES), *((flags, (1, 240)) for flags in FLAGS[1:])]  # with any flags the lowest and the highest rate


@pytest.mark.parametrize(("flags", "rates"), soaked([*SHORT, *((flags, RATES) for flags in FLAGS)], short=SHORT))
def test_the_distance_does_not_depend_on_the_rate_of_the_trace(
    flags: tuple[str, ...], rates: tuple[int, ...], tmp_path: Path
) -> None:
    found = []
    for rate in rates:
        text = f"{DROP}agreement: {{position: 0.5 mm}}\ntrace: {{rate: {rate} Hz}}\n"
        code, (first, second) = run(tmp_path, text, *flags)
        verdict = compared(second)["the same position"]
        found.append((code, first["status"], second["status"], verdict["measured"], verdict["time"]))
        # t = 0 and every step after it.
        assert verdict["judged"] == {"moments": 241, "first": 0.0, "last": 1.0}
    ((code, _, status, measured, time),) = set(found)
    assert (code, status) == (1, "failed")
    # The impact: no row of a trace at 10 Hz is near.
    assert measured > 5e-4
    assert 0.3 < time < 0.4


def test_a_stored_trace_shows_less_than_there_is(tmp_path: Path) -> None:
    _, both = run(tmp_path, f"{DROP}agreement: {{position: 0.5 mm}}\n")
    first, second = (load_trace(tmp_path / "sim-results" / outcome["trace"]) for outcome in both)
    assert len(first) == len(second) == 11
    shown = abs(first.base_position_xyz - second.base_position_xyz).max()
    assert shown < 0.5 * compared(both[1])["the same position"]["measured"]


def test_nothing_but_the_results_is_left(tmp_path: Path) -> None:
    scratch = tmp_path / "tmp"
    scratch.mkdir()
    (tmp_path / "ball.urdf").write_text(BALL)
    (tmp_path / "a.sim.yml").write_text(f"{DROP}agreement: {{position: 30 cm}}\n")
    assert fresh_sim_action(tmp_path, "run", TMPDIR=str(scratch)).returncode == 0
    assert not list(scratch.iterdir())
    assert sorted(path.suffix for path in (tmp_path / "sim-results/traces").iterdir()) == [".npz"] * 2


@pytest.mark.parametrize("model", ["arm.urdf", "arm.urdf.xacro"])
def test_a_bolted_arm_agrees_by_its_joints_and_links(model: str, tmp_path: Path) -> None:
    asked = "{joints: {swing: 0.1 deg, '*': 0.01}, links: {tip: {position: 1 mm, orientation: 0.1 deg}}}"
    code, (_, second) = run(tmp_path, f"{SWINGS.replace('MODEL', model)}agreement: {asked}\n")
    assert code == 0
    found = compared(second)
    assert list(found) == [
        "the same verdicts",
        "the same position of joint 'swing'",
        "the same position of joints '*'",
        "the same position of link 'tip'",
        "the same orientation of link 'tip'",
    ]
    units = [verdict["unit"] for verdict in found.values()]
    assert (units[1], units[3:]) == ("rad", ["m", "rad"])
    assert all(0 < verdict["measured"] < verdict["limit"] for verdict in list(found.values())[1:])
    tight = "{joints: {swing: 1e-17}, links: {tip: {position: 1e-17}}}"
    code, (_, second) = run(tmp_path, f"{SWINGS.replace('MODEL', model)}agreement: {tight}\n")
    assert (code, second["status"]) == (1, "failed")
    assert [verdict["passed"] for verdict in compared(second).values()] == [True, False, False]


@pytest.mark.parametrize("model", ["arm.urdf", "arm.urdf.xacro"])
@pytest.mark.parametrize(
    ("agreement", "message"),
    [
        ("{position: 1 mm}", "such as joints: {rail: 1 cm} [fixed-base]"),
        ("{joints: {swong: 1 deg}}", "the model has no moving joint 'swong'; did you mean 'swing'?"),
        ("{joints: {rail: 1 deg}}", "joint 'rail' slides: 'deg' is not a unit of length"),
        ("{links: {tipp: {position: 1 mm}}}", "the robot has no link 'tipp'; did you mean 'tip'?"),
    ],
)
def test_an_agreement_about_nothing_is_refused_on_its_line(
    agreement: str, message: str, model: str, tmp_path: Path
) -> None:
    code, both = run(tmp_path, f"{SWINGS.replace('MODEL', model)}agreement: {agreement}\n")
    assert code == 2
    for outcome in both:
        (failure,) = outcome["failures"]
        assert message in failure["message"]
        assert failure["location"]["line"] == 7


def test_a_bolted_arm_is_measured_by_its_joints(tmp_path: Path) -> None:
    code, (_, second) = run(tmp_path, SWINGS.replace("MODEL", "arm.urdf"), "--backend", "all")
    assert code == 0
    names = ["difference of turning joints to pybullet 3.2.7", "difference of sliding joints to pybullet 3.2.7"]
    assert [each["name"] for each in second["measurements"]] == names
    assert [each["unit"] for each in second["measurements"]] == ["rad", "m"]
    assert all(0 < each["measured"] < 0.01 for each in second["measurements"])


def test_a_pushed_body_is_compared_from_its_appearance(tmp_path: Path) -> None:
    boxes = """\
world:
  objects:
    - {name: wall, box: [0.1, 1, 0.5], pose: {x: 5}}
    - {name: late, box: [0.2, 0.2, 0.2], mass: 1, pose: {x: 2, y: 1, z: 0.5}, appears: 0.5 s}
    - {name: pushed, box: [0.2, 0.2, 0.2], mass: 0.2, pose: {x: 0.4}}
"""
    text = DROP.replace("ball.urdf", "turtlebot3_burger").replace(", pose: {z: 0.6}", "").replace("1 s", "2 s")
    drives = "commands: {twist: [{linear: 0.3}]}\n"
    asked = "agreement: {bodies: {pushed: {position: 10 cm, orientation: 20 deg}, late: {position: 5 cm}}}\n"
    _, (_, second) = run(tmp_path, text + drives + boxes + asked)
    found = compared(second)
    assert found["the same position of body 'pushed'"]["judged"]["moments"] == 481
    assert found["the same position of body 'late'"]["judged"]["first"] == 0.5
    assert found["the same position of body 'pushed'"]["measured"] > 1e-4
    assert found["the same position of body 'late'"]["measured"] < 0.05


SLOWER_IN_MUJOCO = """\
import sys
from sim_action import Twist

def control(observation):
    return Twist.planar(0.5 if "pybullet" in sys.modules else 0.4)
"""


def test_runs_of_different_length_are_compared_up_to_the_end_of_the_shorter_one(tmp_path: Path) -> None:
    (tmp_path / "ctl.py").write_text(SLOWER_IN_MUJOCO)
    text = LEAST.replace("1.5 m", "1 m").replace(
        "  twist:\n    - {linear: 1.0}", "  script: ctl.py\n  function: control"
    )
    code, (first, second) = run(tmp_path, f"{text}agreement: {{position: 1 m}}\n")
    assert code == 0
    assert second["sim_time"] - first["sim_time"] > 0.3
    position = compared(second)["the same position"]
    assert position["judged"]["last"] == position["time"] == first["sim_time"]
    assert 0.1 < position["measured"] < 0.3
    ends = f"(compared until {first['sim_time']:.4g} s, where the run in pybullet 3.2.7 ended; "
    assert ends + f"{second['engine']} ran {second['sim_time']:.4g} s)" in position["message"]


CRASH = "import os\ndef control(observation):\n    os._exit(3)\n"
RAISES = "def control(observation):\n    raise ValueError('no')\n"
# Without load on the machine: the loop that computes is among the tests of execution.
HANGS = "import time\ndef control(observation):\n    time.sleep(600)\n"


@pytest.mark.parametrize(
    ("script", "title", "backend"),
    [
        (CRASH, "exit 3", ENGINE_NAMES[0]),
        (RAISES, "script error", "auto"),
        (RAISES, "script error", ENGINE_NAMES[-1]),
        (HANGS, "wall limit", ENGINE_NAMES[-1]),
    ],
    ids=["exit", "raise", "raise in another", "hang"],
)
def test_an_error_names_the_engine_that_ran(script: str, title: str, backend: str, tmp_path: Path) -> None:
    (tmp_path / "ctl.py").write_text(script)
    # A busy machine takes seconds for the start of an interpreter.
    limit = "4 s" if script == HANGS else "10 min"
    commands = "commands: {script: ctl.py, function: control, rate: 10 Hz}"
    text = f"{DROP}{commands}\nwall_limit: {limit}\nbackend: {backend}\n"
    code, (outcome,) = run(tmp_path, text)
    assert code == 1
    assert outcome["failures"][0]["title"] == title
    engine = named_version(installed()[0] if backend == "auto" else backend)
    assert outcome["engine"] == engine
    for report in ("junit.xml", "report.html"):
        assert engine in (tmp_path / "sim-results" / report).read_text()


@pytest.mark.parametrize("backend", ["auto", *ENGINE_NAMES])
def test_every_outcome_names_the_engine_that_ran(backend: str, tmp_path: Path) -> None:
    engine = named_version(installed()[0] if backend == "auto" else backend)
    # A verdict, and an error of a model that only the run itself reads.
    broken = SWINGS.replace("MODEL", "arm.urdf.xacro").replace("name: swing,", "name: swong,")
    (tmp_path / "b.sim.yml").write_text(f"{broken}backend: {backend}\n")
    run(tmp_path, f"{DROP}backend: {backend}\n")
    summary = tmp_path / "summary.md"
    said = sim_action(tmp_path, "run", GITHUB_STEP_SUMMARY=str(summary))
    engines = [(outcome["status"], outcome["engine"]) for outcome in outcomes(tmp_path)]
    assert engines == [("passed", engine), ("error", engine)]
    assert said.stdout.count(engine) == 2
    assert summary.read_text().count(engine) >= 2


DRIVES = driving("drives", at_least="1 m")


def test_all_engines_run_it_under_names_of_their_own_and_are_compared(tmp_path: Path) -> None:
    code, both = run(tmp_path, DRIVES, "--backend", "all")
    assert code == 0
    assert [outcome["name"] for outcome in both] == ["drives [pybullet]", "drives [mujoco]"]
    assert [outcome["engine"].split()[0] for outcome in both] == list(ENGINE_NAMES)
    assert [len(outcome["expectations"]) for outcome in both] == [1, 2]
    assert not both[0]["measurements"]
    position, yaw = both[1]["measurements"]
    assert (position["name"], yaw["name"]) == ("distance to pybullet 3.2.7", "difference in yaw to pybullet 3.2.7")
    assert 0 < position["measured"] < 0.005
    assert 0 < yaw["measured"] < 0.01
    for outcome in both:
        assert len(load_trace(tmp_path / "sim-results" / outcome["trace"])) > 10


def test_agreement_that_was_asked_and_is_missed_fails_on_its_line(tmp_path: Path) -> None:
    code, both = run(tmp_path, f"{DRIVES}agreement: {{position: 0.001 mm}}\n")
    assert code == 1
    assert [outcome["status"] for outcome in both] == ["passed", "failed"]
    (missed,) = [one for one in both[1]["expectations"] if not one["verdict"]["passed"]]
    assert missed["name"] == "the same position as pybullet 3.2.7"
    assert missed["location"]["line"] == 6


def test_each_engine_has_one_digest_alone_and_among_others(tmp_path: Path) -> None:
    for number in range(4):
        (tmp_path / f"{number}.sim.yml").write_text(DRIVES)
    _, alone = run(tmp_path, DRIVES, "--backend", "all")
    sim_action(tmp_path, "run", "--backend", "all", "--jobs", "2")
    several = outcomes(tmp_path)
    assert len(several) == 10
    digests = {(outcome["engine"], outcome["digest"]) for outcome in (*alone, *several)}
    assert len(digests) == len(ENGINE_NAMES)
