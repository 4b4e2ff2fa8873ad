"""When a run is over, and that it is over at the same moment however the blocks are cut."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions.distance import Travel
from sim_action.assertions.no_collision import NoCollision
from sim_action.assertions.stay_within import StayWithin
from sim_action.assertions.temporal_logic.stl_assertion import Stl
from sim_action.scenario.model import Expectation, Scenario
from sim_action.simulation.monitors import End, Panel
from sim_action.state.trace import Trace
from tests.soak import examples
from tests.traces import START, contact, expectation, piece, scenario, scene, trace

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
def test_a_duration_is_what_a_run_lasts_at_least(
    expected: list[Expectation], duration: float, end: End, time: float
) -> None:
    assert ends(*expected, duration=duration) == (end, time)


@pytest.mark.parametrize(
    ("expected", "end", "time"),
    [
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
def test_warnings_do_not_end_a_run(expected: list[Expectation], end: End, time: float) -> None:
    assert ends(*expected) == (end, time)


def test_no_expectation_is_left_that_has_seen_nothing() -> None:
    waiting = expectation(Travel(at_most=100.0), after=7.0)
    assert ends(GOAL, waiting) == ("goals met", 7.0)
    assert ends(waiting, duration=5.0) == ("duration", 7.0)
    panel, _ = seen_by(scenario(GOAL, waiting), ride())
    assert [verdict.time for verdict in panel.verdicts()] == [3.0, 7.0]


def test_a_run_that_is_not_over_goes_on() -> None:
    panel, seen = seen_by(scenario(FAR_GOAL), ride(5))
    assert panel.end is None
    assert len(seen) == 5
    assert not panel.verdicts()[0].passed


def test_verdicts_are_those_of_the_end_though_the_block_went_on() -> None:
    panel, seen = seen_by(scenario(GOAL, expectation(NoCollision())), ride(10, 2.5, 5.0))
    assert panel.end == "expectation failed"
    assert panel.time == 3.0
    assert [touch.time for touch in seen.contacts] == [2.5]
    assert [verdict.time for verdict in panel.verdicts()] == [3.0, 2.5]


@pytest.mark.parametrize(
    ("expected", "duration", "soon"),
    [
        pytest.param(FAR_GOAL, None, [True, True], id="a goal ends the run when it comes true"),
        pytest.param(FAR_GOAL, 4.0, [False, True], id="but not before the duration"),
        pytest.param(HOLDS, None, [False, False], id="no goal"),
    ],
)
def test_runs_that_can_only_fail_soon_are_looked_at_less_often(
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


def test_a_goal_that_something_else_cut_short_says_so() -> None:
    panel, _ = seen_by(scenario(FAR_GOAL, BREAKS), ride())
    undecided, broken = panel.verdicts()
    assert undecided.message == "travelled 6 m of 100 m in 6.0 s, when the run ended"
    assert broken.message == "travelled 6 m at 6.00 s, more than 5 m"
    assert (undecided.cut_off, broken.cut_off) == (True, False)


def test_that_the_run_was_over_is_told_once() -> None:
    panel, _ = seen_by(scenario(expectation(Stl(formula="eventually travel > 99 m")), BREAKS), ride())
    assert [verdict.message.count("the run ended") for verdict in panel.verdicts()] == [1, 0]


def test_a_goal_whose_window_never_opened_says_once_that_the_run_was_over() -> None:
    panel, _ = seen_by(scenario(expectation(Travel(at_least=100.0), after=9.0), BREAKS), ride())
    unopened, _ = panel.verdicts()
    assert unopened.message == ("never checked: the run ended before 9 s (after); run for longer, or lower 'after'")
    assert (unopened.status, unopened.cut_off) == ("not_exercised", True)


def test_a_goal_that_the_time_limit_cut_short_is_itself_to_blame() -> None:
    panel, _ = seen_by(scenario(FAR_GOAL), ride())
    (missed,) = panel.verdicts()
    assert (missed.message, missed.cut_off) == ("travelled 10 m of 100 m in 10.0 s", False)


def test_a_goal_whose_window_had_closed_was_cut_short_by_nothing() -> None:
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
