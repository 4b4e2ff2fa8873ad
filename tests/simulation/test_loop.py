from __future__ import annotations

import os
import sys
from itertools import pairwise
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions.distance import Travel
from sim_action.assertions.no_collision import NoCollision
from sim_action.assertions.stay_within import StayWithin
from sim_action.assertions.temporal_logic.stl_assertion import Stl
from sim_action.commands import ClosedLoop
from sim_action.commands.twist import TwistCommands
from sim_action.core.geometry import Pose, Twist
from sim_action.scenario.loading import build_scene
from sim_action.scenario.model import Expectation, LoadedScenario, Scenario
from sim_action.scenario.mutation import Mutation
from sim_action.sensors import Measure, Mount, MountedSensor, Sensor
from sim_action.simulation import panel
from sim_action.simulation.loop import SimulationRun, simulate
from sim_action.simulation.mutations import MutantSeams
from sim_action.simulation.panel import End, Panel
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace, Transcript
from tests.patience import wait_until
from tests.scenarios import LEAST, load
from tests.soak import examples
from tests.traces import START, contact, expectation, piece, scenario, scene, trace

# Answers until its input ends, as programs do.
PROGRAM = """\
import os, sys
open("number", "w").write(str(os.getpid()))
for line in sys.stdin:
    print("{}", flush=True)
print("farewell", flush=True)
"""


class Faulty(Sensor):
    """A sensor that cannot be opened, though nothing was wrong with it before."""

    key: ClassVar[str] = "faulty"

    def open(self, mount: Mount) -> Measure:
        raise KeyError("nowhere")


def driven_by_a_program(folder: Path) -> LoadedScenario:
    program = folder / "ctl.py"
    program.write_text(f"#!{sys.executable}\n{PROGRAM}")
    program.chmod(0o700)
    drives = "commands:\n  process: ./ctl.py\n"
    text = LEAST.replace("commands:\n  rate: 10 Hz\n  twist:\n    - {linear: 1.0}\n", drives)
    assert text != LEAST
    return load(folder, text)


def is_there(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.process
def test_programs_are_ended_when_a_sensor_cannot_be_opened(tmp_path: Path) -> None:
    loaded = driven_by_a_program(tmp_path)
    sensor = MountedSensor(Faulty(), "eye", None, Pose(), 10.0, trace=True)
    scenario = loaded.scenario.model_copy(update={"sensors": (sensor,)})
    with pytest.raises(KeyError, match="nowhere"):
        simulate(scenario, build_scene(loaded), lambda _: None)
    program = int((tmp_path / "number").read_text())
    wait_until(lambda: not is_there(program))


@pytest.mark.process
def test_what_a_program_says_at_the_end_is_noted(tmp_path: Path) -> None:
    loaded = driven_by_a_program(tmp_path)
    scenario = loaded.scenario.model_copy(update={"time_limit": 0.2})
    notes = simulate(scenario, build_scene(loaded), lambda _: None).notes
    assert "the process './ctl.py' wrote more lines than it received, such as 'farewell'; if " in notes[-1]


@pytest.mark.parametrize(
    ("expect", "end"),
    [
        ("[{travel: {at_least: 30 cm}}]", "goals met"),
        ("[{max_speed: {linear: 50 cm/s}}]", "expectation failed"),
        ("[{max_speed: {linear: 20 m/s}}]", "time limit"),
    ],
)
def test_periods_change_no_result(expect: str, end: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # The monitors see many steps at once. The end of a run may lie anywhere within such a period.
    loaded = load(tmp_path, LEAST.partition("expect:")[0] + f"expect: {expect}\ntime_limit: 2.6 s\n")

    def run() -> SimulationRun:
        return simulate(loaded.scenario, build_scene(loaded), lambda _: None)

    usual = run()
    monkeypatch.setattr(panel, "_PERIOD_S", 1.7)
    monkeypatch.setattr(panel, "_PERIOD_WITHOUT_GOALS_S", 0.3)
    other = run()
    assert usual.end == other.end == end
    assert (usual.digest, usual.verdicts, usual.findings) == (other.digest, other.verdicts, other.findings)
    assert usual.trace.time.tolist() == other.trace.time.tolist()


@pytest.mark.parametrize("faults", ["", "faults: [{motor: wheel_left_joint, weak: 90 %, at: 0.1 s}]\n"])
def test_a_run_that_looks_ahead_has_the_notes_of_its_end(faults: str, tmp_path: Path) -> None:
    push = "{disturb: {force: [1 N, 0, 0], for: 0.1 s, at: 1 s}}"
    late = f"events:\n  - {{name: late, when: {{at: 1.6 s}}, do: [{push}]}}\n"
    loaded = load(tmp_path, LEAST.replace("1.5 m", "1 m") + faults + late)
    scene = build_scene(loaded)
    usual = simulate(loaded.scenario, scene, lambda _: None)
    ahead = simulate(loaded.scenario, scene, lambda _: None, seams=MutantSeams(Mutation(looks_ahead=True), scene))
    assert usual.sim_time < 1.6 < 1.2 * usual.sim_time
    assert [verdict.extreme is None for verdict in (*usual.verdicts, *ahead.verdicts)] == [True, False]
    assert ahead.notes == usual.notes


@pytest.mark.parametrize("allowed", [False, True])
def test_messages_of_nodes_are_in_the_digest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, allowed: bool) -> None:
    runs = list[SimulationRun]()
    for message in (None, b"1", b"1", b"2"):
        transcript, reasons = Transcript(), list[str]()

        def command(seen: Observation, transcript: Transcript = transcript, message: bytes | None = message) -> Twist:
            if message is not None:
                transcript.add(seen.time, "/cmd_vel", message)
            return Twist.planar(1.0)

        driven = ClosedLoop(command, transcript=transcript, not_reproducible=reasons)
        monkeypatch.setattr(TwistCommands, "open", lambda *_, driven=driven: driven)
        loaded = load(tmp_path, LEAST + ("allow: [not-reproducible]\n" if allowed else ""))
        reasons.append("a node was never quiet")
        runs.append(simulate(loaded.scenario, build_scene(loaded), lambda _: None))
    without, first, same, other = (run.digest for run in runs)
    assert first == same
    assert len({without, first, other}) == 3
    found = [(finding.rule, finding.message) for finding in runs[0].findings]
    told = ("not-reproducible", "the run is not reproducible: a node was never quiet")
    assert found == ([] if allowed else [told])


@pytest.mark.parametrize("allowed", [False, True])
def test_errors_of_nodes_are_findings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, allowed: bool) -> None:
    errors = list[str]()

    def command(_: Observation) -> Twist:
        errors[:] = ["the node 'mover' logged an error: no plan"]
        return Twist.planar(1.0)

    driven = ClosedLoop(command, logged_errors=errors)
    monkeypatch.setattr(TwistCommands, "open", lambda *_: driven)
    loaded = load(tmp_path, LEAST + ("allow: [logged-error]\n" if allowed else ""))
    run = simulate(loaded.scenario, build_scene(loaded), lambda _: None)
    found = [(finding.rule, finding.message) for finding in run.findings]
    assert found == ([] if allowed else [("logged-error", errors[0])])


GOAL = expectation(Travel(at_least=3.0))
FAR_GOAL = expectation(Travel(at_least=100.0))
HOLDS = expectation(Travel(at_most=100.0))
BREAKS = expectation(Travel(at_most=5.0))


def ride(seconds: int = 12, *touches: float) -> Trace:
    """1 m/s, a moment a second."""
    time = [float(second) for second in range(1, seconds + 1)]
    return trace(time, x=time, contacts=[contact(touch) for touch in touches])


def seen_by(made: Scenario, ridden: Trace) -> tuple[Panel, Trace]:
    return Panel.open(made, scene(), START).observe_until_end(ridden)


def ends(*expected: Expectation, time_limit: float = 10.0, duration: float | None = None) -> tuple[End | None, float]:
    panel, seen = seen_by(scenario(*expected, time_limit=time_limit, duration=duration), ride())
    assert float(seen.time[-1]) == panel.time
    return panel.end, panel.time


@pytest.mark.parametrize(
    ("expected", "end", "time"),
    [
        ([expectation(Travel(at_most=0.5))], "expectation failed", 1.0),
        ([GOAL], "goals met", 3.0),
        ([GOAL, expectation(Travel(at_least=7.0))], "goals met", 7.0),
        ([GOAL, HOLDS], "goals met", 3.0),
        ([HOLDS], "time limit", 10.0),
        ([FAR_GOAL], "time limit", 10.0),
        ([BREAKS], "expectation failed", 6.0),
        ([FAR_GOAL, BREAKS], "expectation failed", 6.0),
        # Both at once: what is broken comes first.
        ([expectation(Travel(at_least=6.0)), BREAKS], "expectation failed", 6.0),
        # A goal whose `before` has passed.
        ([expectation(Travel(at_least=100.0), before=4.0)], "expectation failed", 4.0),
        ([GOAL, expectation(Travel(at_least=100.0), before=4.0)], "expectation failed", 4.0),
        ([expectation(Travel(at_least=4.0), before=4.0)], "goals met", 4.0),
        # An invariant outside its window.
        ([expectation(Travel(at_most=5.0), before=5.0)], "time limit", 10.0),
        ([expectation(Travel(at_most=5.0), after=8.0)], "expectation failed", 8.0),
        # A warning ends no run.
        ([expectation(Travel(at_most=5.0), severity="warning")], "time limit", 10.0),
        ([FAR_GOAL, expectation(Travel(at_most=5.0), severity="warning")], "time limit", 10.0),
        ([expectation(Travel(at_least=100.0), before=4.0, severity="warning")], "time limit", 10.0),
        # Nor does a warning that comes true cut short what an invariant has to hold for.
        ([HOLDS, expectation(Travel(at_least=3.0), severity="warning")], "time limit", 10.0),
        # A goal that can only warn gets its time all the same.
        ([GOAL, expectation(Travel(at_least=7.0), severity="warning")], "goals met", 7.0),
        ([GOAL, expectation(Travel(at_least=100.0), before=7.0, severity="warning")], "goals met", 7.0),
    ],
)
def test_a_run_ends_with_what_decides_it(expected: list[Expectation], end: End, time: float) -> None:
    assert ends(*expected) == (end, time)


@pytest.mark.parametrize(
    ("expected", "duration", "end", "time"),
    [
        ([GOAL], 2.0, "goals met", 3.0),
        ([GOAL], 5.0, "goals met", 5.0),
        ([HOLDS], 5.0, "duration", 5.0),
        ([FAR_GOAL], 5.0, "time limit", 10.0),
        ([BREAKS], 8.0, "expectation failed", 6.0),
    ],
)
def test_a_run_lasts_at_least_its_duration(expected: list[Expectation], duration: float, end: End, time: float) -> None:
    assert ends(*expected, duration=duration) == (end, time)


def test_no_expectation_is_left_that_has_seen_nothing() -> None:
    waiting = expectation(Travel(at_most=100.0), after=7.0)
    assert ends(GOAL, waiting) == ("goals met", 7.0)
    assert ends(waiting, duration=5.0) == ("duration", 7.0)
    panel, _ = seen_by(scenario(GOAL, waiting), ride())
    assert [verdict.time for verdict in panel.verdicts()] == [3.0, 7.0]


def test_verdicts_are_those_of_the_end_though_the_block_went_on() -> None:
    panel, seen = seen_by(scenario(GOAL, expectation(NoCollision())), ride(10, 2.5, 5.0))
    assert panel.end == "expectation failed"
    assert panel.time == 3.0
    assert [touch.time for touch in seen.contacts] == [2.5]
    assert [verdict.time for verdict in panel.verdicts()] == [3.0, 2.5]
    # A run that is not over goes on.
    panel, seen = seen_by(scenario(FAR_GOAL), ride(5))
    assert panel.end is None
    assert len(seen) == 5
    assert not panel.verdicts()[0].passed


@pytest.mark.parametrize(
    ("expected", "duration", "soon"),
    [
        pytest.param(FAR_GOAL, None, [True, True], id="a goal ends the run when it comes true"),
        pytest.param(FAR_GOAL, 4.0, [False, True], id="but not before the duration"),
        pytest.param(HOLDS, None, [False, False], id="no goal"),
    ],
)
def test_runs_that_only_fail_are_looked_at_seldom(
    expected: Expectation, duration: float | None, soon: list[bool]
) -> None:
    made = Panel.open(scenario(expected, duration=duration), scene(), START)
    assert [made.observe(ride(seconds)).may_end_soon for seconds in (3, 4)] == soon


TO_4_1_M = expectation(Travel(at_least=4.1))
TO_4_3_M = expectation(Travel(at_least=4.3))


@pytest.mark.parametrize(
    ("expected", "period"),
    [
        pytest.param([TO_4_1_M], 0.105, id="the goal comes true in 0.1 s"),
        pytest.param([TO_4_1_M, TO_4_3_M], 0.315, id="the last goal counts"),
        pytest.param([TO_4_1_M, FAR_GOAL], 0.5, id="a goal is far away"),
        pytest.param([expectation(Travel(at_least=4.01))], 0.05, id="very soon"),
        pytest.param([HOLDS], 1.0, id="no goal"),
    ],
)
def test_few_steps_are_simulated_after_a_goal_comes_true(expected: list[Expectation], period: float) -> None:
    earlier = Panel.open(scenario(*expected), scene(), START).observe(ride(3))
    assert earlier.observe(ride(4).rows(slice(3, 4))).next_period(earlier) == pytest.approx(period)


@pytest.mark.parametrize("still", [True, False])
def test_a_goal_without_a_pace_is_awaited_for_half_a_second(still: bool) -> None:
    start = Panel.open(scenario(TO_4_1_M), scene(), START)
    assert start.next_period(start) == 0.5
    stands = trace([1.0, 2.0], x=[4.0, 4.0] if still else [4.0, 3.0])
    earlier = start.observe(stands.first(1))
    assert earlier.observe(stands.rows(slice(1, 2))).next_period(earlier) == 0.5


@pytest.mark.parametrize("time_limit", [1 / 3, 0.1, 0.7, 10.000000003, 1.0000000001])
def test_the_last_step_reaches_the_time_limit_whatever_the_rounding(time_limit: float) -> None:
    made = scenario(FAR_GOAL, time_limit=time_limit)
    last = made.steps(time_limit)
    steps = trace([(last - 1) / 240, last / 240])
    assert seen_by(made, steps.first(1))[0].end is None
    assert seen_by(made, steps)[0].end == "time limit"


EXPECTED = [
    GOAL,
    FAR_GOAL,
    HOLDS,
    expectation(Travel(at_most=4.0), severity="warning"),
    expectation(Travel(at_least=4.0), before=8.0),
    expectation(Travel(at_least=50.0), before=8.0, severity="warning"),
    expectation(StayWithin(y=(-0.4, 0.4)), after=2.0),
    expectation(NoCollision(), after=3.0, before=9.0),
]


@examples(50)
@given(
    st.lists(st.sampled_from(EXPECTED), min_size=1, max_size=4),
    st.none() | st.sampled_from([1.0, 6.0]),
    st.integers(0, 2**32 - 1),
    st.lists(st.integers(0, 100), max_size=8),
)
def test_the_end_is_the_same_however_the_blocks_are_cut(
    expected: list[Expectation], duration: float | None, seed: int, at: list[int]
) -> None:
    rng = np.random.default_rng(seed)
    time = [step / 10 for step in range(1, 101)]
    x, y = np.cumsum(rng.normal(0.05, 0.1, 100)), np.cumsum(rng.normal(0, 0.03, 100))
    touches = [contact(when) for when in time if rng.random() < 0.01]
    ridden = trace(time, x=x.tolist(), y=y.tolist(), contacts=touches)
    made = scenario(*expected, duration=duration)
    panel, _ = seen_by(made, ridden)
    assert panel.end is not None
    cut = Panel.open(made, scene(), START)
    for start, end in pairwise(sorted({0, *at, 100})):
        if cut.end is None:
            cut, _ = cut.observe_until_end(piece(ridden, start, end))
    assert (cut.end, cut.time, cut.verdicts()) == (panel.end, panel.time, panel.verdicts())


def test_a_goal_that_something_else_cut_short_says_so_once() -> None:
    panel, _ = seen_by(scenario(FAR_GOAL, BREAKS), ride())
    undecided, broken = panel.verdicts()
    assert undecided.message == "travelled 6 m of 100 m in 6.0 s, when the run ended"
    assert broken.message == "travelled 6 m at 6.00 s, more than 5 m"
    assert (undecided.cut_off, broken.cut_off) == (True, False)
    panel, _ = seen_by(scenario(expectation(Stl(formula="eventually travel > 99 m")), BREAKS), ride())
    assert [verdict.message.count("the run ended") for verdict in panel.verdicts()] == [1, 0]
    # Its window never opened.
    panel, _ = seen_by(scenario(expectation(Travel(at_least=100.0), after=9.0), BREAKS), ride())
    unopened, _ = panel.verdicts()
    assert unopened.message == ("never checked: the run ended before 9 s (after); run for longer, or lower 'after'")
    assert (unopened.status, unopened.cut_off) == ("not_exercised", True)


def test_a_goal_that_the_time_limit_or_its_window_cut_short_is_itself_to_blame() -> None:
    panel, _ = seen_by(scenario(FAR_GOAL), ride())
    (missed,) = panel.verdicts()
    assert (missed.message, missed.cut_off) == ("travelled 10 m of 100 m in 10.0 s", False)
    closed = expectation(Travel(at_least=100.0), severity="warning", before=3.0)
    panel, _ = seen_by(scenario(closed, BREAKS), ride())
    assert panel.end == "expectation failed"
    assert [(verdict.passed, verdict.cut_off) for verdict in panel.verdicts()] == [(False, False)] * 2


def test_a_run_that_goes_on_ends_with_its_goals_or_its_time_and_judges_everything() -> None:
    both = scenario(FAR_GOAL, BREAKS, expectation(Travel(at_most=8.0)), time_limit=10.0)
    panel, seen = Panel.open(both, scene(), START, runs_on=True).observe_until_end(ride())
    assert (panel.end, float(seen.time[-1])) == ("time limit", 10.0)
    assert [(verdict.passed, verdict.cut_off) for verdict in panel.verdicts()] == [(False, False)] * 3
    panel, _ = Panel.open(scenario(GOAL, BREAKS), scene(), START, runs_on=True).observe_until_end(ride())
    assert (panel.end, panel.time) == ("goals met", 3.0)
