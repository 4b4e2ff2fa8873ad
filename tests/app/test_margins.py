"""Margins: thresholds with a closed form, on both engines; gates, reports and what has no margins."""

from __future__ import annotations

import json
import math
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import sim_action
from sim_action.cli.main import call
from sim_action.core.errors import Location, UsageError
from sim_action.core.field_types import Placement
from sim_action.core.records import replace
from sim_action.results.factor_margins import Margin
from sim_action.results.results_json import Results
from sim_action.runner.margin_search import FACTORS, Factor, Search, Trial
from sim_action.runner.mutation.mutant import Original
from sim_action.scenario.loading import load_scenario
from tests.integration.engines import on_every_engine
from tests.outcomes import outcome
from tests.soak import soaked
from tests.traces import trace

G = 9.81
BOX = "{{name: box, box: [0.2, 0.2, 0.2], mass: {mass}, friction: {friction}, pose: {{x: 2, z: 0.1}}}}"
STILL = "robot: {{model: turtlebot3_burger}}\ntime_limit: 2 s\nduration: 2 s\n"


def box(push: str, limit: float = 0.02, mass: float = 1.0, friction: float = 1.0) -> str:
    body = BOX.format(mass=mass, friction=friction)
    return STILL.format() + (
        f"world: {{objects: [{body}], ground: {{friction: 0.5}}, disturbances: [{{body: box, at: 0 s, {push}}}]}}\n"
        f"expect: [{{object: {{name: box, stay_within: {{x: [1.9, {2 + limit}]}}}}}}]\n"
    )


def drive(expected: str, speed: float = 0.2, limit: str = "3 s") -> str:
    return (
        f"robot: {{model: turtlebot3_burger}}\ncommands: {{twist: [{{linear: {speed}}}], rate: 10 Hz}}\n"
        f"expect: [{expected}]\nduration: {limit}\ntime_limit: {limit}\n"
    )


ARM = """
robot: {model: arm.urdf, joints: {j: 0}}
commands: {joints: [{at: 0 s, position: {j: 0}}], rate: 10 Hz}
expect: [{joint: {name: j, at_most: 0.1 rad}}]
duration: 1 s
time_limit: 1 s
"""
URDF = """<robot name="arm"><link name="world"/><link name="l"><inertial><origin xyz="0.5 0 0"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="revolute"><parent link="world"/><child link="l"/><origin xyz="0 0 1"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="10" velocity="9"/></joint></robot>"""
HOLDS = 1.0 * G * 0.5
# A controller of the speed that drives to a place 5 cm ahead, and whose error must not grow.
TO_PLACE = """
robot: {model: turtlebot3_burger}
commands: {script: to_place.py, rate: 20 Hz}
expect: [{stay_within: {x: [-0.05, 0.125]}}]
duration: 60 s
time_limit: 60 s
"""
SCRIPT = """from sim_action import Twist


def control(observation):
    return Twist.planar(2 * (0.05 - observation.pose.position_xyz[0]))
"""
# Commands are held for 50 ms, half of which delays them.
GROWS = math.pi / 2 / 2 - 0.025
PUSHED_XACRO = """
robot: {model: box.urdf.xacro}
world: {ground: {friction: 0.5}, disturbances: [{link: base, at: 0 s, for: 2 s, force: [3, 0, 0]}]}
expect: [{travel: {at_least: 1 cm}}]
time_limit: 2 s
"""
XACRO = """<robot name="box" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="m" value="0.3"/>
<link name="base"><inertial><mass value="${m}"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="0.4 0.4 0.02"/></geometry></collision></link>
<gazebo reference="base"><mu1>1</mu1></gazebo></robot>"""
MJCF = """<mujoco><worldbody><body name="l" pos="0 0 1"><joint name="j" axis="0 1 0" range="-170 170"/>
<geom type="box" size="0.1 0.02 0.02" pos="0.4 0 0" mass="0.5" contype="0" conaffinity="0"/>
<body name="tip" pos="0.6 0 0"><inertial pos="0 0 0" mass="0.5" diaginertia="0.01 0.01 0.01"/></body>
</body></worldbody><actuator><position name="a" joint="j" kp="2000" kv="20" forcerange="-10 10"/></actuator></mujoco>"""
HEAVY = '<mass value="9"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
BASE = f'<link name="base"><inertial>{HEAVY}</inertial></link>'
BOLTED = URDF.replace('<link name="world"/>', BASE).replace('parent link="world"', 'parent link="base"')
FILES = {"arm.urdf": URDF, "bolted.urdf.xacro": BOLTED, "arm.xml": MJCF, "box.urdf.xacro": XACRO, "to_place.py": SCRIPT}
STRAIGHT = "{stay_within: {x: [-1, 0.7], y: [-0.2, 0.2]}}"

PLANTED = {
    "friction at which a force moves a box": (box("force: [3, 0, 0], for: 2 s"), "friction", "down", 3 / G),
    "force that moves a box": (box("force: [2, 0, 0], for: 2 s"), "push", "up", 0.5 * G / 2),
    "speed at which a box slides too far": (
        box("velocity: [1, 0, 0]", 0.2),
        "push",
        "up",
        math.sqrt(2 * 0.5 * G * 0.2),
    ),
    "mass at which a force moves a box": (
        box("force: [3, 0, 0], for: 2 s"),
        "world.objects.box.mass=0.1 kg:1 kg",
        "down",
        3 / (0.5 * G),
    ),
    "latency at which a robot is late": (drive("{travel: {at_least: 0.4 m}}"), "latency", "up", 3 - 0.42 / 0.2),
    "start from which a robot drives too far": (drive(STRAIGHT), "start:x", "up", 0.7 - 0.58),
    "heading in which a robot leaves its lane": (drive(STRAIGHT), "start:yaw", "up", math.asin(0.2 / 0.58)),
    "speed at which a robot leaves its lane": (
        drive(STRAIGHT),
        "commands.twist.0.linear=0.05:0.5",
        "up",
        3 - math.sqrt(9 - 2 * 0.7),
    ),
    "payload that a motor cannot hold": (ARM, "payload", "up", 10 / (G * 0.5) - 1),
    "strength that a motor needs": (ARM, "motor-strength", "down", HOLDS / 10),
    "masses that a motor cannot hold": (ARM, "mass", "up", 10 / HOLDS),
    "masses of MJCF that a motor cannot hold": (ARM.replace("arm.urdf", "arm.xml"), "mass", "up", 10 / HOLDS),
    "payload that a motor of MJCF cannot hold": (
        ARM.replace("arm.urdf", "arm.xml"),
        "payload",
        "up",
        (10 / G - 0.5) / 0.6,
    ),
    "payload that a motor of xacro cannot hold": (
        ARM.replace("arm.urdf", "bolted.urdf.xacro, base: fixed"),
        "payload",
        "up",
        10 / (G * 0.5) - 1,
    ),
    "payload with which a robot of xacro stands": (PUSHED_XACRO, "payload", "up", 3 / (0.5 * G) - 0.3),
    "latency from which a controller oscillates": (TO_PLACE, "latency", "up", GROWS),
}

SHORT = ["friction at which a force moves a box", "strength that a motor needs"]


def margins_of(folder: Path, text: str, *options: str, code: int = 0) -> list[dict[str, Any]]:
    path = folder / "one.sim.yml"
    needed = {folder / name: content for name, content in FILES.items() if name in text}
    for file, content in {path: f"name: one\n{text}", **needed}.items():
        file.write_text(content)
    results = folder / "results"
    words = ["margins", str(path), "--allow-outside", "--no-report", "--output-dir", str(results), "-q", *options]
    assert call(words) == code
    [scenario] = json.loads((results / "margins" / "margins.json").read_text())["scenarios"]
    margins: list[dict[str, Any]] = scenario["margins"]
    return margins


@pytest.mark.process
@on_every_engine
@pytest.mark.parametrize("case", soaked(PLANTED, SHORT))
def test_planted_thresholds_are_found(tmp_path: Path, engine: str, case: str) -> None:
    pytest.importorskip(engine)
    if "MJCF" in case and engine == "pybullet":
        pytest.skip("MuJoCo alone reads MJCF")
    text, factor, direction, threshold = PLANTED[case]
    sides = margins_of(tmp_path, text, "--factor", factor, "--backend", engine)
    [side] = [each for each in sides if each["direction"] == direction]
    assert side["fails"] is not None
    assert (side["passes"] + side["fails"]) / 2 == pytest.approx(threshold, rel=0.05)
    assert sum(each["runs"] for each in sides) <= 20


PUSHED = box("force: [3, 0, 0], for: 2 s") + "backend: mujoco\n"


@pytest.mark.process
def test_a_missed_demand_fails_alike_with_one_and_two_jobs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mujoco")
    demands = ("--at-least", "friction=50%", "--factor", "latency", "--factor", "start:yaw", "--runs", "12")
    several = [
        margins_of(
            tmp_path, PUSHED + DRIVEN, *demands, "--report", "-j", jobs, "--junit", str(tmp_path / "j.xml"), code=1
        )
        for jobs in "12"
    ]
    assert several[0] == several[1]
    told = capsys.readouterr().out
    assert "friction down: fails already at 0.3" in told
    assert "x real time" not in told  # of the nominal run in the time of all
    assert "below 0.5; 50 % below 0.5 was asked: object stay_within of box" in told
    junit = (tmp_path / "j.xml").read_text()
    assert '"measured: friction down"' in junit
    assert '"sim_time_s"' in junit
    assert "│████████████████████ friction: fails at 0.3" in junit
    page = (tmp_path / "results" / "margins" / "report.html").read_text()
    assert page.count('class="tornado margin-bar"') == 3
    assert (page.count('height="8" class="held"'), page.count('height="8" class="missed"')) == (5, 5)
    by_name = {(each["factor"], each["direction"]): each for each in several[0]}
    assert by_name["latency", "up"]["fails"] is None
    assert [each["has_effect"] for each in several[0] if each["factor"] == "start:yaw"] == [True, True]


DRIVEN = "commands: {twist: [{linear: 0.2}], rate: 10 Hz}\n"


@pytest.mark.process
def test_a_smaller_margin_is_shown_by_compare(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mujoco")
    folders = []
    for friction in ("0.5", "0.35"):
        folder = tmp_path / friction
        folder.mkdir()
        margins_of(folder, PUSHED.replace("friction: 0.5", f"friction: {friction}"), "--factor", "friction")
        folders.append(str(folder / "results" / "margins"))
    for names in (folders, [f"{folder}/margins.json" for folder in folders]):
        capsys.readouterr()
        assert call(["compare", *names, "--strict"]) == 1
        assert "friction down: margin 0.1943, now 0.04478" in capsys.readouterr().out


@pytest.mark.process
def test_a_scenario_that_fails_has_no_margins(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    text = PUSHED.replace("friction: 0.5", "friction: 0.1")
    assert margins_of(tmp_path, text, "--factor", "friction", code=1) == []
    [scenario] = json.loads((tmp_path / "results" / "margins" / "margins.json").read_text())["scenarios"]
    assert scenario["reason"].startswith("it has no margins, because it failed (box crossed the bound x = 2.02 m")


@pytest.mark.process
@pytest.mark.parametrize(("text", "code", "note"), [(PUSHED, 1, "sim-action: 1 run in all\n"), ("", 2, "")])
def test_runs_are_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, code: int, note: str) -> None:
    pytest.importorskip("mujoco")
    path = tmp_path / "one.sim.yml"
    path.write_text(f"name: one\n{text.replace('friction: 0.5', 'friction: 0.1')}")
    words = ["margins", str(path), "--allow-outside", "--no-report", "--output-dir", str(tmp_path), "--factor", "mass"]
    assert call(words) == code
    notes = capsys.readouterr().err.splitlines(keepends=True)
    assert "".join(line for line in notes if " in all" in line) == note


@pytest.mark.process
def test_an_interrupted_search_leaves_reports_and_no_pass_and_goes_on_with_resume(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("mujoco")
    factors = ("--factor", "friction", "--factor", "mass", "--runs", "10")
    whole = margins_of(tmp_path, PUSHED, *factors)
    assert [side["end"] for side in whole if side["factor"] == "mass"] == pytest.approx([0.2, 5.0])
    wanted = Search.next_values

    def interrupted(search: Search) -> Any:
        # The nominal run and the scan have ended.
        if search.sides[0].trials:
            os.kill(os.getpid(), signal.SIGINT)
        return wanted(search)

    with monkeypatch.context() as changed:
        changed.setattr(Search, "next_values", interrupted)
        assert margins_of(tmp_path, PUSHED, *factors, code=130) == []
    folder = tmp_path / "results" / "margins"
    [run] = Results.read(folder / "results.json").outcomes
    assert (run.status, [failure.kind for failure in run.failures]) == ("error", ["interrupted"])
    assert run.failures[0].message.startswith("sim-action ended before this scenario ended; run 1 passed; run ")
    capsys.readouterr()
    assert margins_of(tmp_path, PUSHED, *factors, "--resume") == whole
    runs = 1 + sum(each["runs"] for each in whole)
    assert f"--resume: 16 of {runs} runs taken over" in capsys.readouterr().err
    assert margins_of(tmp_path, PUSHED, *factors, "--resume", "-j", "2") == whole
    assert f"--resume: {runs - 1} of {runs} runs taken over" in capsys.readouterr().err
    # Another scenario takes over nothing.
    assert margins_of(tmp_path, PUSHED.replace("force: [3,", "force: [2.9,"), *factors, "--resume") != whole
    message = capsys.readouterr().err
    assert message.startswith("sim-action: --resume: 0 of ")
    parts = "scenarios, or their seeds and engines, files that scenarios name"
    assert message.endswith(f" taken over; since then, these have changed: {parts}\n")


@pytest.mark.process
def test_shards_have_the_margins_of_the_whole(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    one, other = (f"{PUSHED}".replace("force: [3,", f"force: [{force},") for force in (3, 2))
    for name, text in (("a", one), ("b", other)):
        (tmp_path / f"{name}.sim.yml").write_text(f"name: {name}\n{text}")

    def margins(*options: str) -> list[object]:
        results = tmp_path / "results"
        words = ["margins", str(tmp_path), "--allow-outside", "--no-report", "--output-dir", str(results), "-q"]
        assert call([*words, "--factor", "friction", "--runs", "8", *options]) == 0
        scenarios: list[object] = json.loads((results / "margins" / "margins.json").read_text())["scenarios"]
        return scenarios

    assert [*margins("--shard", "1/2"), *margins("--shard", "2/2", "-j", "2")] == margins()


@pytest.mark.process
def test_margins_from_python(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    scenario = tmp_path / "one.sim.yml"
    scenario.write_text(f"name: one\n{PUSHED}")
    [found] = sim_action.margins(scenario, allow_outside=True, at_least=["friction=50%"], runs=8, output_dir=tmp_path)
    assert [(each.direction, each.is_kept) for each in found.margins] == [("down", False), ("up", True)]
    assert (tmp_path / "margins" / "report.html").exists()
    with pytest.raises(UsageError, match="'frictoin' is neither a factor nor a key"):
        sim_action.margins(scenario, allow_outside=True, factors="frictoin")
    with pytest.raises(UsageError, match="at_least: expected FACTOR=AMOUNT"):
        sim_action.margins(scenario, allow_outside=True, at_least=["friction=0"])


@pytest.mark.process
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--factor", "frictoin"), "'frictoin' is neither a factor nor a key of"),
        (("--factor", "noise"), "no scenario that passes has the factor noise"),
        (("--factor", "latency=1 s:2 s"), "the range does not contain the nominal value, 0 s"),
        (("--factor", "latency=0 kg:1 kg"), "latency has the unit 's', not 'kg'"),
        (("--factor", "latency=1"), "expected KEY=FROM:TO"),
        (("--factor", "world.ground.friction"), "a key needs a range"),
        (("--at-least", "latency=20%"), "the nominal value is 0, so it has no share"),
        (("--at-least", "latency=-1 s"), "expected FACTOR=AMOUNT"),
        (("--factor", "friction", "--budget", "3"), "--budget: 20 runs may be needed, 3 are allowed"),
    ],
)
def test_bad_option(tmp_path: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, ...], message: str) -> None:
    pytest.importorskip("mujoco")
    path = tmp_path / "one.sim.yml"
    path.write_text(f"name: one\n{PUSHED}{DRIVEN}")
    assert call(["margins", str(path), "--allow-outside", "--output-dir", str(tmp_path / "r"), "-q", *options]) == 2
    assert message in capsys.readouterr().err


def test_the_payload_of_an_arm_names_its_link(tmp_path: Path) -> None:
    path = tmp_path / "one.sim.yml"
    path.write_text(f"name: one\n{ARM}")
    (tmp_path / "arm.urdf").write_text(URDF)
    [factor] = FACTORS["payload"](Original(load_scenario(path), outcome("one.sim.yml"), trace([0.0])))
    load = {"at": 0, "payload": 2.0, "link": "l"}
    assert list(factor.edits(2.0)) == [(("world", "disturbances"), (load,))]


@pytest.mark.parametrize(("pose", "nominal"), [({}, 1.5), ({"yaw": 0.3}, 0.3)])
def test_the_start_varies_from_that_of_a_keyframe(tmp_path: Path, pose: dict[str, float], nominal: float) -> None:
    path = tmp_path / "one.sim.yml"
    path.write_text(f"name: one\n{PUSHED}")
    loaded = load_scenario(path)
    robot = loaded.scenario.robot.model_copy(update={"keyframe": "stands", "pose": Placement(**pose)})
    scenario = loaded.scenario.model_copy(update={"robot": robot})
    original = Original(replace(loaded, scenario=scenario), outcome("one.sim.yml"), trace([0.0], yaw=[1.5]))
    assert [factor.nominal for factor in FACTORS["start"](original)] == [0, 0, pytest.approx(nominal)]


def both_sides(factor: Factor, passes: Callable[[float], bool], asked: float | None, most: int) -> list[Margin]:
    """Return the margins of a factor in its directions, found without a simulation."""
    search = Search(factor, asked, most)
    while wanted := search.next_values():
        for side, value in wanted:
            side.trials.append(Trial(value))
            side.trials[-1].take(outcome("a.sim.yml", holds=passes(value)))
    return list(search.margins("other"))


def searched(passes: Callable[[float], bool], asked: float | None = None, most: int = 20) -> Margin:
    """Return the margin above 1 of a factor from 1 to 5."""
    [margin] = both_sides(Factor("f", "m", 1.0, 1.0, 5.0), passes, asked, most)
    return margin


@pytest.mark.parametrize("most", [1, 2, 3, 5])
def test_few_runs_are_shared_by_both_directions(most: int) -> None:
    margins = both_sides(Factor("f", "m", 3.0, 1.0, 5.0), lambda _: True, None, most)
    runs = [margin.runs for margin in margins]
    assert sum(runs) == most
    assert max(runs) - min(runs) <= 1
    # A direction without a run has no margin, and the reason.
    for margin in margins:
        assert (margin.reason, margin.expected(Location("a.sim.yml", 1)).verdict.margin is None) == (
            ("", False) if margin.runs else ("no run was left", True)
        )


@given(st.floats(1.02, 4.99), st.integers(5, 20))
def test_bisection_comes_as_near_as_its_runs_allow(threshold: float, most: int) -> None:
    margin = searched(lambda value: value < threshold, most=most)
    assert margin.runs <= most
    assert margin.passes < threshold <= (margin.fails or 0.0)
    assert (margin.fails or 0.0) - margin.passes <= max(1.0 / 2 ** (most - 4), 0.04)


def test_a_demand_is_judged_at_its_own_value() -> None:
    kept, missed = (searched(lambda value: value < 1.3, asked=asked) for asked in (0.299, 0.301))
    assert (kept.is_kept, missed.is_kept) == (True, False)
    # The range grows to what is demanded.
    assert searched(lambda _: True, asked=9.0).message == "never fails up to 10 m, 900 % above 1 m"
    margin = searched(lambda value: value < 1.5 or value > 2.5)
    assert margin.threshold == pytest.approx(1.5, abs=0.02)
    assert "2 changes between passing and failing were seen" in margin.message


def test_a_factor_without_effect_is_not_exercised() -> None:
    margin = searched(lambda _: True)
    still = margin.model_copy(update={"has_effect": False})
    assert still.message == "has no effect: the robot moves alike in 4 runs up to 5 m"
    place = Location("a.sim.yml", 1)
    assert still.expected(place).status == "warned"
    assert still.model_copy(update={"asked": 1.0}).expected(place).status == "not_exercised"
    assert margin.expected(place).status == "passed"
