"""The curves of real runs are what their verdicts say: they come to their limits, or pass them, where those say so."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from sim_action.assertions import ASSERTIONS, Assertion
from sim_action.assertions.combined import AtOnce, Combined, Negation
from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.windows import Window
from sim_action.core.geometry import Pose, Twist
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.permissions import Permissions
from sim_action.reports import ReportOptions
from sim_action.reports.github.mermaid_chart import chart, load_replay, signal_of_verdict
from sim_action.results.results_json import Results
from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.scenario.model import Expectation
from sim_action.simulation.loop import simulate
from sim_action.state.observation import JointState, Observation
from sim_action.state.trace import Trace
from sim_action.state.verdict import Signal, Verdict
from sim_action.world.scene import Scene
from tests.integration.test_examples import ROOT, in_failing_form, sim_action


@dataclass(frozen=True)
class Shown:
    """A curve, and whether its lower limit, and its upper one, have to be met but once."""

    signal: Signal
    goals: tuple[bool, bool]

    @property
    def rounding(self) -> float:
        """How far off it may be: what it changes between two moments that are stored."""
        return float(np.abs(np.diff(self.signal.values)).max(initial=0.0)) + 1e-9

    def at(self, time: float) -> float:
        return float(np.interp(time, self.signal.time, self.signal.values))

    def is_goal(self, limit: float) -> bool:
        return self.goals[0 if limit == self.signal.lower else 1]

    def margins(self, limit: float) -> FloatArray:
        """Of the moments that the limit holds for; positive on the good side."""
        signal, sign = self.signal, 1 if limit == self.signal.lower else -1
        inside = (signal.time >= signal.start - 1e-9) & (signal.time <= signal.end + 1e-9)
        return np.asarray(sign * (signal.values[inside] - limit), dtype=np.float64)


def start_of(trace: Trace) -> Observation:
    rows = zip(trace.joint_position[0], trace.joint_velocity[0], trace.joint_effort[0], strict=True)
    joints = {name: JointState(*map(float, row)) for name, row in zip(trace.joint_names, rows, strict=True)}
    pose = Pose(tuple(trace.base_position_xyz[0].tolist()), tuple(trace.base_orientation_xyzw[0].tolist()))
    twist = Twist(tuple(trace.base_linear_xyz[0].tolist()), tuple(trace.base_angular_xyz[0].tolist()))
    return Observation(0.0, pose, twist, joints)


def shown(expected: Expectation, scene: Scene, start: Observation, trace: Trace) -> list[Shown]:
    signals = expected.signals(scene, start, trace)
    # The time for which a goal holds, and the number of conditions, are goals of their own.
    held = expected.assertion.held(scene, start, trace, (expected.after, expected.before), expected.span)
    counts = Window(expected.assertion.monitor(scene, start), expected.after, expected.before).signals(trace)
    goals = [(True, False)] * len((*held, *(counts if isinstance(expected.assertion, AtOnce) else ())))
    goals += [
        (not upper, not lower) if contrary else (lower, upper)
        for part, contrary in leaves(expected.assertion)
        for signal in part.signals(scene, start, trace, expected.after, expected.before)
        for lower, upper in [goal_sides(part, signal, pending=part.monitor(scene, start).state is State.PENDING)]
    ]
    return [Shown(signal, sides) for signal, sides in zip(signals, goals, strict=True)]


def goal_sides(part: Assertion, signal: Signal, *, pending: bool) -> tuple[bool, bool]:
    """Of assertions that may be goals and invariants at once, `at_least` is the goal, but for `clearance`."""
    if part.key in ("travel", "path_length", "joint"):
        return pending, pending and signal.lower is None
    if part.key == "contact":
        return pending, False
    if part.key == "clearance":
        return False, pending
    return (pending and signal.name != "distance from the path",) * 2


def leaves(assertion: Assertion, *, contrary: bool = False) -> Iterator[tuple[Assertion, bool]]:
    if not isinstance(assertion, Combined):
        yield assertion, contrary
        return
    for _, part in assertion.placed_parts:
        yield from leaves(part, contrary=contrary != isinstance(assertion, Negation))


def decisive(curves: list[Shown], verdict: Verdict) -> Shown:
    assert verdict.measured is not None
    assert verdict.time is not None
    measured, time = verdict.measured, verdict.time
    alike = [one for one in curves if one.signal.unit == verdict.unit]
    alike = [one for one in alike if verdict.limit in (one.signal.lower, one.signal.upper)]
    return min(alike, key=lambda one: abs(one.at(time) - measured) / one.rounding)


def check(curves: list[Shown], verdict: Verdict) -> None:
    curve = decisive(curves, verdict)
    assert verdict.measured is not None
    assert verdict.time is not None
    assert verdict.limit is not None
    assert curve.at(verdict.time) == pytest.approx(verdict.measured, abs=curve.rounding)
    margins = curve.margins(verdict.limit)
    is_goal = curve.is_goal(verdict.limit)
    if curve.signal.start == curve.signal.end or curve.signal.name.startswith("gap"):
        assert bool(margins[-1] >= 0) is verdict.passed
    elif verdict.passed:
        assert (margins.max() if is_goal else margins.min()) >= -curve.rounding
    else:
        assert (margins.max() if is_goal else margins.min()) < 0


def check_formula(curves: list[Shown], verdict: Verdict) -> None:
    (robustness,) = (one.signal for one in curves if one.signal.name == "robustness")
    assert bool(robustness.values[-1] >= 0) is verdict.passed
    assert verdict.measured is not None
    assert verdict.time is not None
    near = [abs(one.at(verdict.time) - verdict.measured) / one.rounding for one in curves]
    assert min(near) <= 1.0


@pytest.fixture(scope="module")
def examples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return shutil.copytree(ROOT / "examples", tmp_path_factory.mktemp("copy") / "examples")


@pytest.mark.parametrize("fails", [False, True], ids=["holds", "fails"])
@pytest.mark.parametrize("key", [key for key in ASSERTIONS if key != "assertion"])
def test_a_curve_passes_its_limit_where_the_verdict_says_so(key: str, fails: bool, examples: Path) -> None:
    path = examples / f"assertions/{key}.sim.yml"
    if fails:
        text = in_failing_form(path.read_text())[0]
        path = path.with_name(f"{key}-fails.sim.yml")
        path.write_text(text)
    loaded = load_scenario(path, Permissions(outside=True))
    # What assertions read of sensors is not stored otherwise.
    kept = tuple(replace(mounted, trace=True) for mounted in loaded.scenario.sensors)
    scene = build_scene(loaded)
    run = simulate(loaded.scenario.model_copy(update={"sensors": kept}), scene, lambda _: None)
    start = start_of(run.trace)
    for expected, verdict in zip(loaded.scenario.expect, run.verdicts, strict=True):
        curves = shown(expected, scene, start, run.trace)
        if not verdict.cut_off:
            (check_formula if expected.assertion.key == "stl" else check)(curves, verdict)
    assert all(verdict.passed for verdict in run.verdicts) is not fails


def test_the_replay_of_a_run_holds_the_curve_that_each_verdict_is_about(tmp_path: Path) -> None:
    """Also of sensors that no trace keeps; the summary draws it."""
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    for key in SHOWN:
        path = tmp_path / f"examples/assertions/{key}.sim.yml"
        path.write_text(in_failing_form(path.read_text())[0])
    files = [f"examples/assertions/{key}.sim.yml" for key in SHOWN]
    assert sim_action(tmp_path, "run", *files).returncode == 1
    folder = tmp_path / "sim-results"
    results = Results.read(folder / "results.json")
    options = ReportOptions(folder, folder / "junit.xml", junit_strict=False, environment={}, workspace=tmp_path)
    assert len(results.outcomes) == len(SHOWN)
    for outcome in results.outcomes:
        replay = load_replay(outcome, options)
        assert replay is not None
        ((number, missed),) = [pair for pair in enumerate(outcome.expectations) if pair[1].failed]
        found, verdict = signal_of_verdict(replay, number, missed.verdict), missed.verdict
        assert found is not None
        assert found.unit == verdict.unit
        # One moment is no curve: the run ended at t = 0.
        assert chart(found, verdict.time) or not outcome.sim_time
        shown_curve = Shown(found, (False, False))
        assert verdict.time is not None
        assert shown_curve.at(verdict.time) == pytest.approx(verdict.measured, rel=1e-3, abs=shown_curve.rounding)


SHOWN = (
    *("max_speed", "upright", "sensor", "odometry_error", "clearance"),
    *("no_collision", "settled", "contact", "energy"),
)
