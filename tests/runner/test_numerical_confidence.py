"""Numerical confidence: repetitions with one change each, and what they leave open of a verdict."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import sim_action
from sim_action.cli.main import call
from sim_action.core.errors import InvalidScenario, Location
from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.core.records import replace
from sim_action.core.units import rate_divides
from sim_action.results.outcome import Failure, Outcome
from sim_action.results.results_json import Results
from sim_action.robot.model.robot_model import Keyframe
from sim_action.runner.numerical_confidence import divergence, with_confidence, with_repetitions
from sim_action.scenario.loading import load_scenario
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.variations.gate import Gate, PlannedGate
from sim_action.state.trace import COLUMNS, Trace
from sim_action.state.verdict import Signal, Verdict
from sim_action.world import Physics, World
from sim_action.world.scene import Scene
from tests.integration.engines import on_every_engine
from tests.outcomes import like, outcome

SCENARIO = """
name: drive
robot: {{model: {model}}}
commands: {{twist: [{{linear: 0.2}}], rate: 10 Hz}}
expect: [{{stay_within: {{x: [-1, 1]}}}}]
confidence: {kind}
{more}
time_limit: 2 s
"""


def scenario(folder: Path, kind: str = "numerical", more: str = "", model: str = "turtlebot3_burger") -> LoadedScenario:
    path = folder / "drive.sim.yml"
    path.write_text(SCENARIO.format(kind=kind, more=more, model=model))
    return load_scenario(path)


def run(margin: float, **stated: Any) -> Outcome:
    verdict = Verdict(margin >= 0, 1 - margin, 1.0, margin, "m", 2.0, "somewhere")
    one = outcome("drive.sim.yml", holds=verdict.passed)
    expected = like(one.expectations[0], verdict=replace(verdict, **stated))
    return like(one, expectations=(expected,), sim_time=2.0, name="drive")


def judged(loaded: LoadedScenario, ours: Outcome, **others: Outcome) -> Outcome:
    names = {"half": "half the step", "quarter": "a quarter of the step", "turned": "the start turned by 1 deg"}
    return with_confidence(loaded, ours, {names[key]: other for key, other in others.items()})


def test_the_repetitions_have_one_change_each(tmp_path: Path) -> None:
    nominal, half, turned, moved = with_repetitions(scenario(tmp_path))
    assert (nominal.repetition, nominal.scenario.name) == ("", "drive")
    assert half.scenario.physics.rate == 2 * nominal.scenario.physics.rate
    assert half.scenario.robot == nominal.scenario.robot
    pose = turned.scenario.robot.pose
    assert (pose.x, pose.yaw) == pytest.approx((0.0, 0.0174533), rel=1e-5)
    pose = moved.scenario.robot.pose
    assert (pose.x**2 + pose.y**2) ** 0.5 == pytest.approx(1e-3)
    fixed = load_scenario(_arm(tmp_path))
    assert [each.repetition for each in with_repetitions(fixed)] == ["", "half the step"]
    # A start that a keyframe states is turned from there.
    _, _, turned, _ = with_repetitions(scenario(tmp_path))
    assert turned.model is not None
    stands = Keyframe({}, Pose((0, 0, 1), quaternion_from_rpy(0.2, 0, 1.5)))
    robot = turned.scenario.robot.model_copy(update={"keyframe": "stands"})
    model = replace(turned.model, keyframes={"stands": stands})
    place = Scene(robot, model, World(), Physics(), turned.source.workspace).placement
    assert (place.roll, place.yaw, place.z) == pytest.approx((0.2, 1.5 + math.radians(1), 1))


def test_a_named_engine_and_a_quarter_of_the_step_are_repetitions(tmp_path: Path) -> None:
    several = with_repetitions(scenario(tmp_path, "full", "engines: [pybullet, mujoco]\nbackend: pybullet"))
    assert [each.repetition for each in several[1:]] == [
        "half the step",
        "a quarter of the step",
        "the start turned by 1 deg",
        "the start moved by 1 mm",
        "MuJoCo",
    ]
    assert several[-1].scenario.backend == "mujoco"


def _arm(folder: Path) -> Path:
    path = folder / "arm.sim.yml"
    text = SCENARIO.format(kind="numerical", more="", model="kuka_iiwa").replace(
        "{model: kuka_iiwa}", "{model: a.urdf}"
    )
    text = text.replace("commands: {twist: [{linear: 0.2}], rate: 10 Hz}\n", "").replace(
        "{stay_within: {x: [-1, 1]}}", "{joint: {name: j, at_most: 3 rad}}"
    )
    link = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    (folder / "a.urdf").write_text(
        f'<robot name="a"><link name="world"/><link name="l">{link}</link><joint name="j" type="revolute">'
        '<parent link="world"/><child link="l"/><axis xyz="0 1 0"/>'
        '<limit lower="-3" upper="3" effort="9" velocity="9"/></joint></robot>'
    )
    path.write_text(text)
    return path


@given(st.integers(1, 2000), st.integers(1, 50))
def test_rates_that_divide_a_rate_divide_its_double(rate: int, steps: int) -> None:
    assert rate_divides(2.0 * rate * steps, float(rate))


@pytest.mark.parametrize(
    ("ours", "half", "status"),
    [
        # The converged difference is twice that to half the step, 2 cm.
        (0.061, 0.051, "passed"),
        (0.006, -0.004, "inconclusive"),
        (0.006, 0.016, "inconclusive"),
        (-0.061, -0.051, "failed"),
        (-0.006, -0.016, "inconclusive"),
        (-0.006, 0.004, "inconclusive"),
        (0.0, 0.0, "passed"),
    ],
)
def test_planted_margins_are_decided_or_not(tmp_path: Path, ours: float, half: float, status: str) -> None:
    found = judged(scenario(tmp_path), run(ours), half=run(half))
    assert found.status == status
    assert found.exit_code == (0 if status == "passed" else 1)
    [spread] = found.expectations[0].spreads
    assert (spread.low, spread.high) == pytest.approx((ours - 2 * abs(ours - half), ours + 2 * abs(ours - half)))


def test_an_open_verdict_says_what_moves_it(tmp_path: Path) -> None:
    found = judged(scenario(tmp_path), run(0.003), half=run(-0.006), turned=run(0.0031))
    [expected] = found.expectations
    assert expected.message == "passes by 0.003 m, but halving the step moves it by 0.009 m (somewhere)"
    assert expected.verdict.inconclusive == "numerical"
    assert [each.is_decided for each in expected.spreads] == [False, True]


@pytest.mark.parametrize(("ours", "status"), [(0.003, "passed"), (-0.003, "failed")])
def test_open_verdicts_can_be_accepted(tmp_path: Path, ours: float, status: str) -> None:
    loaded = scenario(tmp_path, more="inconclusive: warn")
    found = judged(loaded, run(ours), half=run(-2 * ours))
    assert (found.status, found.expectations[0].status) == (status, "warned" if ours > 0 else "failed")


def test_a_contact_that_is_there_or_not_is_a_jump(tmp_path: Path) -> None:
    free, touched = (run(margin, unit="contacts", message=text) for margin, text in ((0.0, "free"), (-1.0, "hit it")))
    found = judged(scenario(tmp_path), free, half=free, turned=touched)
    assert found.expectations[0].message == (
        "passes, but with the start turned by 1 deg it fails: hit it; it jumps between these runs (free)"
    )
    assert judged(scenario(tmp_path), free, half=free, turned=free).status == "passed"


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["goal that is met", "invariant that fails"])
@pytest.mark.parametrize(
    ("extreme", "half", "unit", "is_open"),
    [
        # The converged difference is twice that to half the step: the margins are 3.05 and 0.3 times that.
        (0.061, 0.051, "m", False),
        (0.006, 0.016, "m", True),
        # The times, which leave 0.5 s and differ by 0.01 s, leave more open than margins that are large or unknown.
        (0.061, 0.0611, "s", False),
        (None, 0.061, "s", False),
    ],
)
def test_the_extreme_margin_of_an_early_decision_counts(
    tmp_path: Path, sign: float, extreme: float | None, half: float, unit: str, *, is_open: bool
) -> None:
    early = {"goal": sign > 0, "passed": sign > 0, "limit": 1.0}
    ours = run(sign * 1e-5, **early, time=1.5, extreme=None if extreme is None else sign * extreme)
    theirs = run(sign * 1e-5, **early, time=1.51, extreme=sign * half)
    [expected] = judged(scenario(tmp_path), ours, half=theirs).expectations
    [spread] = expected.spreads
    assert (spread.unit, spread.is_decided) == (unit, not is_open)
    if unit == "s":
        assert (spread.low, spread.high) == pytest.approx((sign * 0.5 - 0.02, sign * 0.5 + 0.02))
    assert expected.status == ("inconclusive" if is_open else "passed" if sign > 0 else "failed")


def test_the_extreme_margin_is_that_in_the_window() -> None:
    time = np.arange(5.0)
    met = Verdict(True, 1.0, 1.0, 0.0, "m", 1.0, goal=True)
    curve = Signal("way", "m", time, np.array([0.0, 1.0, 1.5, 1.2, 9.0]), lower=1.0, end=3.0)
    assert met.with_extreme([curve]).extreme == 0.5
    failed = replace(met, passed=False, goal=False)
    assert failed.with_extreme([replace(curve, lower=None, upper=1.0)]).extreme == -0.5
    either = replace(curve, lower=1.0, upper=-1.0)
    assert met.with_extreme([either]).extreme == 0.5
    # A curve with another limit or unit, or one that has no value, says nothing; nor does a decision at the end.
    others = [replace(curve, lower=2.0), replace(curve, unit="s"), replace(curve, values=np.full(5, np.nan))]
    assert met.with_extreme(others).extreme == 0.0
    assert replace(met, goal=False).with_extreme([curve]).extreme is None


def test_missing_repetitions_leave_notes_or_an_open_verdict(tmp_path: Path) -> None:
    loaded = scenario(tmp_path, more="physics: {rate: 60 kHz}")
    assert [run.repetition for run in with_repetitions(loaded)][1:] == [
        "the start turned by 1 deg",
        "the start moved by 1 mm",
    ]
    [note] = judged(loaded, run(0.5), turned=run(0.5)).notes
    assert note == "no repetition with half the step: a physics rate of 120000 Hz is more than is allowed"
    crash = Failure(kind="crash", title="SIGSEGV", message="it ended")
    broken = like(run(0.5), status="error", failures=(crash,), expectations=())
    found = judged(scenario(tmp_path), run(0.5), half=broken)
    assert found.status == "inconclusive"
    assert (
        "with half the step there is no verdict: ended in an error (SIGSEGV: it ended)" in found.expectations[0].message
    )


def test_the_budget_is_known_before_the_first_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = scenario(tmp_path).source.path
    folder = tmp_path / "results"
    assert call(["run", str(path), "--budget", "3", "--allow-outside", "--output-dir", str(folder)]) == 2
    assert "--budget: 4 runs would be needed, 3 are allowed" in capsys.readouterr().err
    assert not folder.exists()


@pytest.mark.parametrize(
    ("half", "quarter", "note", "status"),
    [
        (0.03, 0.02, "it converges to 0.01 m with order 1", "passed"),
        (0.01, 0.0, "it converges to -0.01 m with order 0.58", "inconclusive"),
        (0.045, 0.06, "it does not converge", "passed"),
        (0.03, 0.1, "it does not converge", "inconclusive"),
    ],
)
def test_a_quarter_step_shows_the_order(tmp_path: Path, half: float, quarter: float, note: str, status: str) -> None:
    found = judged(scenario(tmp_path, "full"), run(0.05), half=run(half), quarter=run(quarter))
    if "0.58" not in note:
        assert found.expectations[0].spreads[0].note == note
    assert found.status == status


def test_a_gate_has_no_confidence_of_each_run(tmp_path: Path) -> None:
    loaded = scenario(tmp_path)
    gate = Gate.model_validate({"passes": {"at_least": 0.9}, "runs": 29})
    planned = PlannedGate(
        name="drive", group="drive", file="drive.sim.yml", location=Location("drive.sim.yml"), runs=29, gate=gate
    )
    with pytest.raises(InvalidScenario, match="a gate already judges many runs"):
        with_repetitions(replace(loaded, source=replace(loaded.source, gate=planned)))


DRIVE = """
name: drive
robot: {{model: turtlebot3_burger}}
backend: {engine}
confidence: numerical
commands: {{twist: [{{linear: 0.2, for: 2 s}}, {{linear: 0}}], rate: 10 Hz}}
expect:
  - travel: {{at_least: 0.39 m}}
  - reach: {{x: 0.41, y: 0, tolerance: 10.3 mm}}
  - stay_within: {{x: [-1, 0.3997]}}
  - stay_within: {{x: [-1, 0.38]}}
duration: 3 s
time_limit: 4 s
"""


@pytest.mark.process
@on_every_engine
def test_goals_and_invariants_that_are_decided_early_are_judged_by_their_extreme(tmp_path: Path, engine: str) -> None:
    # The ramps cancel out, so the robot stops at 0.4 m. A start that is moved by 1 mm moves the stop by 0.7 mm.
    pytest.importorskip(engine)
    path = tmp_path / "drive.sim.yml"
    path.write_text(DRIVE.format(engine=engine))
    [ran] = sim_action.run(path, jobs=1, output_dir=tmp_path / "results").runs
    assert [expected.status for expected in ran.expectations] == ["passed", "inconclusive", "inconclusive", "failed"]
    page = (tmp_path / "results" / "report.html").read_text()
    assert all(f'id="repetition-s0{number}"' in page for number in ("", "-2", "-3"))


FALL = """
name: fall
robot: {{model: turtlebot3_burger}}
physics: {{settle: 0 s}}
backend: {engine}
confidence: numerical
expect: [{{object: {{name: ball, stay_within: {{z: [5 m, 20 m]}}}}}}]
world: {{objects: [{{name: ball, sphere: {{radius: 0.1 m}}, mass: 1, pose: {{z: 10 m, x: 2}}}}]}}
duration: 1 s
time_limit: 1 s
variations: {{"expect.0.object.stay_within.z": [[5.0142 m, 20 m], [5.0702 m, 20 m], [5.0822 m, 20 m], [5.13 m, 20 m]]}}
"""


@pytest.mark.process
@on_every_engine
def test_a_fall_is_judged_as_its_converged_error_says(tmp_path: Path, engine: str) -> None:
    # Semi-implicit Euler falls g t h / 2 = 20.4 mm too far. The margins are 3, 0.3, -0.3 and -2.6 times that.
    pytest.importorskip(engine)
    path = tmp_path / "fall.sim.yml"
    path.write_text(FALL.format(engine=engine))
    several = [sim_action.run(path, report=False, jobs=jobs).runs for jobs in (1, 2)]
    assert [each.status for each in several[0]] == ["passed", "inconclusive", "inconclusive", "failed"]
    assert [each.expectations for each in several[0]] == [each.expectations for each in several[1]]


TIME = np.arange(0, 10, 0.1)


def motion(start: float = 0.0, drift: float = 0.0, joint: np.ndarray[Any, Any] | None = None) -> Trace:
    """Return a circle of 1 m whose start is turned by an angle in rad and moved; `drift` in m/s, away from it."""
    heading = start + TIME
    columns = {name: np.zeros((len(TIME), 3)) for name in COLUMNS if name.startswith("base")}
    columns["base_position_xyz"][:, 0] = np.sin(heading) - np.sin(start) + start + drift * TIME
    columns["base_position_xyz"][:, 1] = np.cos(start) - np.cos(heading)
    half = heading / 2
    columns["base_orientation_xyzw"] = np.column_stack([0 * half, 0 * half, np.sin(half), np.cos(half)])
    columns |= {name: np.zeros((len(TIME), 1)) for name in COLUMNS if name.startswith("joint")}
    columns["joint_position"] = (np.sin(TIME) if joint is None else joint)[:, None]
    return Trace.of_columns(("j",), (), time=TIME, **columns)


def test_only_motions_that_have_nothing_in_common_diverge() -> None:
    ours, half = motion(), "half the step"
    harmless = {
        "the start turned by 1 deg": motion(1.0),  # seen from its start, it is the same
        half: motion(drift=0.05, joint=np.sin(TIME) + 0.04 * TIME),
        "MuJoCo": motion(joint=np.cos(TIME)),
    }
    assert divergence(ours, harmless) == ()
    assert divergence(ours, {half: None}) == divergence(None, {half: ours}) == ()
    jumps = motion(joint=np.where(TIME > 4, 9.0, np.sin(TIME)))
    [parted] = divergence(ours, {**harmless, half: jumps, "the start moved by 1 mm": motion(drift=0.1)})
    assert (parted.time, parted.measured) == pytest.approx((4.1, 5.0), abs=0.01)
    assert parted.message == (
        "chaotic, or at a tipping point: halving the step changes joint j by up to 500 % of its range; places and "
        "times after 4.10 s are those of this run alone"
    )


PENDULUM = """
name: pendulum
robot: {{model: two.urdf, base: fixed, pose: {{z: 5}}, joints: {{a: {angle} deg, b: {angle} deg}}}}
physics: {{settle: 0 s}}
backend: {engine}
confidence: numerical
expect: [{{joint: {{name: a, at_most: 1000 rad}}}}]
duration: 8 s
time_limit: 8 s
"""


@pytest.mark.process
@on_every_engine
@pytest.mark.parametrize(("angle", "diverges"), [(90, True), (5, False)])
def test_a_double_pendulum_is_chaotic_if_high(tmp_path: Path, engine: str, angle: int, *, diverges: bool) -> None:
    pytest.importorskip(engine)
    inertia = " ".join(f'{axes}="{0.01 * (axes[1] == axes[2])}"' for axes in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    link = f'<inertial><origin xyz="0 0 -0.5"/><mass value="1"/><inertia {inertia}/></inertial>'
    joint = '<joint name="{}" type="continuous"><parent link="{}"/><child link="{}"/>{}<axis xyz="0 1 0"/></joint>'
    joints = joint.format("a", "base", "l", "") + joint.format("b", "l", "m", '<origin xyz="0 0 -1"/>')
    links = "".join(f'<link name="{name}">{link}</link>' for name in ("base", "l", "m"))
    (tmp_path / "two.urdf").write_text(f'<robot name="two">{links}{joints}</robot>')
    path = tmp_path / "pendulum.sim.yml"
    path.write_text(PENDULUM.format(engine=engine, angle=angle))
    sim_action.run(path, report=False, output_dir=tmp_path / "results")
    [ran] = Results.read(tmp_path / "results" / "results.json").outcomes
    assert ran.status == "passed"
    assert [each.name for each in ran.measurements] == ["divergence of the motion"] * diverges
