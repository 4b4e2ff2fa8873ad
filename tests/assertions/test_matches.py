"""A run is held against a golden trajectory."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions.matches import Matches
from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.windows import Window
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.workspace import Workspace
from sim_action.state.golden_trajectory import Golden
from sim_action.state.observation import JointState
from sim_action.state.trace import Trace
from sim_action.state.verdict import Judged, Polyline, Verdict
from sim_action.world.scene import Scene
from tests.soak import examples
from tests.traces import START, WHEELS, scene, trace

RATE = 240
STANDING = dataclasses.replace(START, joints={name: JointState(0.0, 0.0, 0.0) for name in WHEELS})


def driven(seconds: float = 2.0, **columns: Callable[[FloatArray], Any]) -> Trace:
    """At 1 m/s along x, at every step after t = 0; `columns`: functions of (T,) s instead."""
    time = np.arange(1, round(seconds * RATE) + 1) / RATE
    return moved(time, **({"x": time} | {name: of(time) for name, of in columns.items()}))


def moved(time: FloatArray, **columns: FloatArray) -> Trace:
    filled: dict[str, Any] = {name: values.tolist() for name, values in columns.items()}
    return trace(time.tolist(), **filled)


def there(folder: Path, **changed: Any) -> Scene:
    return dataclasses.replace(scene(), workspace=Workspace(folder, folder), file="s.sim.yml", **changed)


def kept(folder: Path, seen: Trace, spec: Matches) -> None:
    whole = Trace.concatenate((Trace.of_observation(STANDING), seen))
    Golden.of_trace(spec.form_in(there(folder)), whole, spec.rate).write(folder / spec.trace)


def judged(folder: Path, seen: Trace, **changed: Any) -> Verdict:
    """On a run, against what `driven` is."""
    spec = Matches.model_validate({"trace": "x.csv", **changed})
    kept(folder, driven(), spec)
    return spec.monitor(there(folder), STANDING).observe(seen).verdict()


def test_a_run_matches_itself(tmp_path: Path) -> None:
    verdict = judged(tmp_path, driven(), position=0.02, yaw=0.05)
    assert verdict.passed
    assert verdict.measured is not None
    assert verdict.measured < 1e-4
    assert verdict.message.startswith("at most ")


def test_first_divergence_and_largest_error_are_told(tmp_path: Path) -> None:
    verdict = judged(tmp_path, driven(y=lambda t: np.where(t < 1.5, np.maximum(0, t - 1), 0.0)), position=0.25)
    assert not verdict.passed
    assert verdict.measured == pytest.approx(0.4, abs=1e-3)
    assert (verdict.limit, verdict.unit, verdict.time) == (0.25, "m", 1.4)
    assert verdict.margin == pytest.approx(-0.15, abs=1e-3)
    assert verdict.message.startswith("left x.csv in position at 1.30 s; at most 0.4 m off, at 1.40 s, limit 0.25 m")


def test_what_left_first_speaks(tmp_path: Path) -> None:
    seen = driven(y=lambda t: np.maximum(0, t - 1), yaw=lambda t: np.where(t < 0.75, 0.0, 0.5))
    verdict = judged(tmp_path, seen, position=0.25, yaw=0.1)
    assert verdict.unit == "rad"
    assert verdict.measured == pytest.approx(0.5, abs=1e-3)
    assert verdict.message.startswith("left x.csv in heading at 0.80 s, in position at 1.30 s; at most 28.65 deg off")
    assert "at most 1 m off, at 2.00 s" in verdict.message


def test_a_whole_turn_is_no_difference_of_headings_and_one_of_joints(tmp_path: Path) -> None:
    turned = driven(yaw=lambda t: 0 * t + 2 * np.pi, position=lambda t: 0 * t + 2 * np.pi)
    assert judged(tmp_path, turned, yaw=0.01).passed
    verdict = judged(tmp_path, turned, joints={"wheel_*": "10 deg"})
    assert not verdict.passed
    assert "in wheel_left_joint at 0.10 s" in verdict.message
    assert "wheel_right_joint" not in verdict.message


@pytest.mark.parametrize(("seconds", "which"), [(1.5, "0.50 s shorter than x.csv: ended at 1.50 s"), (2.5, "longer")])
def test_a_run_of_another_length_says_so(seconds: float, which: str, tmp_path: Path) -> None:
    verdict = judged(tmp_path, driven(seconds), position=0.02)
    assert (verdict.passed, verdict.measured, verdict.limit, verdict.unit) == (False, 0.5, 0.2, "s")
    assert which in verdict.message
    assert judged(tmp_path, driven(seconds), position=0.02, duration=0.5).passed


def test_both_are_told_of_a_run_that_went_astray_and_is_too_short(tmp_path: Path) -> None:
    verdict = judged(tmp_path, driven(1.5, y=lambda t: 0 * t + 1), position=0.5)
    assert verdict.unit == "m"
    assert verdict.message.endswith("0.50 s shorter than x.csv: ended at 1.50 s instead of 2.00 s")


def test_it_ends_no_run_and_needs_a_moment(tmp_path: Path) -> None:
    spec = Matches(trace="x.csv", position=0.02)
    kept(tmp_path, driven(), spec)
    opened = spec.monitor(there(tmp_path), STANDING)
    assert opened.observe(driven(y=lambda t: t)).state is State.HOLDS
    assert (opened.verdict().status, opened.verdict().judged) == ("not_exercised", Judged())


def test_a_window_is_compared_alone(tmp_path: Path) -> None:
    spec = Matches(trace="x.csv", position=0.02)
    whole = Trace.concatenate((Trace.of_observation(STANDING), driven()))
    Golden.of_trace(spec.form_in(there(tmp_path)), whole.between(0.5, 1.0), spec.rate).write(tmp_path / "x.csv")
    astray = driven(y=lambda t: np.where((t < 0.5) | (t > 1.0), 1.0, 0.0))
    window = Window(spec.monitor(there(tmp_path), STANDING), after=0.5, before=1.0)
    assert window.observe(astray).verdict().passed
    assert not window.observe(driven(y=lambda t: np.where(t > 0.9, 1.0, 0.0))).verdict().passed


def test_a_window_after_the_end_of_the_golden_run_compares_nothing(tmp_path: Path) -> None:
    spec = Matches(trace="x.csv", position=0.02)
    kept(tmp_path, driven(1.0), spec)
    window = Window(spec.monitor(there(tmp_path), STANDING), after=1.2, before=1.8)
    verdict = window.observe(driven()).verdict()
    assert (verdict.passed, verdict.status) == (False, "not_exercised")
    assert verdict.message == (
        "never checked: x.csv lasts from 0 s to 1 s, and no step of the check lies in this time; "
        "move the window, or record x.csv again from a longer run"
    )


@examples(25)
@given(cuts=st.lists(st.integers(0, 480), max_size=6), rate=st.sampled_from([7.0, 10.0, 240.0, 1000.0]))
def test_it_says_of_pieces_what_it_says_of_the_whole(
    cuts: list[int], rate: float, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("cut")
    spec = Matches(trace="x.csv", position=0.05, yaw=0.05, joints={WHEELS[0]: 0.05}, rate=rate)
    kept(folder, driven(), spec)
    seen = driven(y=lambda t: 0.1 * np.sin(5 * t), yaw=lambda t: 4 * t, position=lambda t: t**2)
    pieces = spec.monitor(there(folder), STANDING)
    edges = [0, *sorted(cuts), len(seen)]
    for start, end in pairwise(edges):
        pieces = pieces.observe(seen.rows(slice(start, end)))
    assert pieces.verdict() == spec.monitor(there(folder), STANDING).observe(seen).verdict()


@pytest.mark.parametrize("rate", [10.0, 30.0, 7.0, 1000.0])
@examples(10)
@given(seed=st.integers(0, 1000))
def test_any_run_matches_itself_within_the_least_tolerance(
    rate: float, seed: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("itself")
    spec = Matches(trace="x.csv", position=2e-4, yaw=4e-4, joints={"*": 2e-4}, rate=rate, duration=0.0)
    draw = np.random.default_rng(seed)
    time = np.arange(1, 2 * RATE + 1) / RATE
    seen = moved(time, **{name: draw.normal(0, 0.05, len(time)).cumsum() for name in ("x", "y", "yaw", "position")})
    kept(folder, seen, spec)
    assert spec.monitor(there(folder), STANDING).observe(seen).verdict().passed


def problems(folder: Path, spec: Matches, **changed: Any) -> list[tuple[tuple[str | int, ...], str]]:
    return list(spec.problems(there(folder, **changed)))


def test_a_missing_file_names_the_command_that_writes_it(tmp_path: Path) -> None:
    [(path, message)] = problems(tmp_path, Matches(trace="golden/x.csv", position=0.02))
    assert path == ("trace",)
    assert message.startswith("'golden/x.csv' does not exist")
    assert message.endswith("'sim-action run --update-golden s.sim.yml' writes it")
    # One outside is not offered to be written.
    [(_, message)] = problems(tmp_path, Matches(trace="../x.csv", position=0.02))
    assert "outside the workspace" in message
    assert "--update-golden" not in message


def test_a_stale_file_is_told_with_its_line_and_what_to_do(tmp_path: Path) -> None:
    kept(tmp_path, driven(), Matches(trace="x.csv", position=0.02))
    [(_, message)] = problems(tmp_path, Matches(trace="x.csv", position=0.02, joints={"*": "1 deg"}))
    assert message.startswith("x.csv:2: expected the columns time_s,x_m,y_m,z_m,yaw_rad,wheel_left_joint_rad,")
    assert message.endswith("; 'sim-action run --update-golden s.sim.yml' rewrites it")


def test_joints_that_are_not_there_and_units_that_do_not_fit(tmp_path: Path) -> None:
    spec = Matches(trace="x.csv", joints={"wheel_lift_joint": 0.1, "wheel_left_joint": "1 cm"})
    told = problems(tmp_path, spec)
    assert [path for path, _ in told] == [("joints", "wheel_lift_joint"), ("joints", "wheel_left_joint")]
    assert "did you mean 'wheel_left_joint'?" in told[0][1]


def test_the_name_of_a_file_may_have_the_variation_in_it(tmp_path: Path) -> None:
    spec = Matches(trace="x-$variation.csv", position=0.02)
    [(_, message)] = problems(tmp_path, spec, variation="friction=0.4")
    assert message.startswith("'x-friction=0.4.csv' does not exist")
    [(_, message)] = problems(tmp_path, spec)
    assert message.startswith("the scenario has no variations, so $variation")


def test_its_curves_are_the_errors_at_golden_moments_and_the_golden_way_is_drawn(tmp_path: Path) -> None:
    spec = Matches(trace="x.csv", position=0.25, yaw=0.1)
    kept(tmp_path, driven(), spec)
    seen = driven(y=lambda t: np.maximum(0, t - 1), yaw=lambda t: 0 * t + 2 * np.pi)
    position, heading = spec.signals(there(tmp_path), STANDING, seen)
    assert (position.name, position.unit) == ("position off the golden run", "m")
    assert (position.lower, position.upper) == (None, 0.25)
    np.testing.assert_allclose(position.time, np.arange(21) / 10)
    np.testing.assert_allclose(position.values, np.maximum(0, position.time - 1), atol=1e-4)
    assert (heading.unit, heading.values.max() < 1e-3) == ("rad", True)
    # A coarse trace shows the moments that it has.
    position, _ = spec.signals(there(tmp_path), STANDING, driven().rows(slice(RATE // 2 - 1, None, RATE // 2)))
    np.testing.assert_allclose(position.time, [0.0, 0.5, 1.0, 1.5, 2.0])
    assert position.values.max() < 1e-3
    [way] = spec.marks(there(tmp_path), STANDING)
    assert isinstance(way, Polyline)
    assert len(way.points) == 21
    assert (way.points[0], way.points[-1]) == ((0.0, 0.0, 0.0), (2.0, 0.0, 0.0))


def test_nothing_is_drawn_of_a_file_that_is_written_anew(tmp_path: Path) -> None:
    spec = Matches(trace="x.csv", position=0.25)
    updating = dataclasses.replace(there(tmp_path), workspace=Workspace(tmp_path, tmp_path, updates_golden=True))
    assert spec.monitor(updating, STANDING).observe(driven()).verdict().passed
    assert spec.marks(updating, STANDING) == ()
    assert spec.signals(updating, STANDING, driven()) == ()
