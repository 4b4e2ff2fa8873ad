"""The page of `sim-action report --history`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from sim_action.cli.main import call
from sim_action.core.errors import UsageError
from sim_action.reports.html.history_page import HISTORY_FILE, History, histories, read_runs, write_history
from sim_action.results.outcome import Failure, Outcome, Scope
from sim_action.state.verdict import Judged, Verdict
from tests.outcomes import like
from tests.reports.samples import SAMPLES, results_of

PASSED = SAMPLES["passed"].outcomes[0]
START = datetime(2026, 11, 1, 8, tzinfo=UTC)
CRASH = Failure(kind="crash", title="SIGSEGV", message="the engine crashed")
CRASHED = like(PASSED, status="error", expectations=(), failures=(CRASH,))


def outcome(margin: float | None) -> Outcome:
    """An invariant with a margin; None: a crash."""
    if margin is None:
        return CRASHED
    verdict = Verdict(passed=margin >= 0, message=f"came to {margin:g} m", margin=margin, unit="m", time=1.0)
    expected = like(PASSED.expectations[0], name="in its lane", verdict=verdict)
    return like(PASSED, status="passed" if margin >= 0 else "failed", expectations=(expected,))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "runs"


def write(folder: Path, margins: Sequence[float | Outcome | None]) -> Path:
    """Results of runs, whose folders have another order than their starts."""
    for number, margin in enumerate(margins):
        place = folder / f"{9 - number}"
        place.mkdir(parents=True)
        started = START + timedelta(days=number)
        run = margin if isinstance(margin, Outcome) else outcome(margin)
        results = results_of(run).model_copy(update={"started_at": started, "commit": f"{number}" * 40})
        results.write(place)
    return folder


def only(folder: Path) -> History:
    (history,) = histories(read_runs([str(folder)]))
    return history


@pytest.mark.parametrize(
    ("margins", "broken"),
    [
        ([0.3, 0.2, 0.1], None),
        ([0.3, -0.1, 0.2], None),
        ([0.3, 0.2, -0.1, -0.2], (1, 2)),
        ([0.3, -0.1, 0.2, -0.2], (2, 3)),
        ([-0.1, -0.2], (None, 0)),
        ([0.3, None, -0.1], (0, 1)),
        ([0.3, None, 0.1], None),
        ([-0.1], (None, 0)),
    ],
)
def test_the_first_bad_run_after_the_last_good_one_broke_it(
    margins: list[float | None], broken: tuple[int | None, int] | None, folder: Path
) -> None:
    history = only(write(folder, margins))
    assert [point.value for point in history.points] == margins
    pair = history.broken
    assert (None if pair is None else (None if pair[0] is None else pair[0].run, pair[1].run)) == broken


def test_the_page_names_the_commit_and_draws_each_run(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(folder, [0.3, 0.2, -0.1, None])
    assert call(["report", "--history", str(folder), "--output-dir", str(folder)]) == 0
    broken = "in its lane: broken by 2222222 (2026-11-03): came to -0.1 m; good until 1111111 (2026-11-02) (margin 0.2"
    assert broken in capsys.readouterr().out
    page = (folder / HISTORY_FILE).read_text(encoding="utf-8")
    assert re.findall(r'class="dot (\w+)"', page) == ["passed", "passed", "failed", "error"]
    assert "1 of 1 expectation broken" in page
    assert "SIGSEGV: the engine crashed" in page
    assert "<script" not in page


@pytest.mark.parametrize(
    ("verdict", "drawn"),
    [
        (Verdict(passed=True, message="arrived", margin=0.1, unit="m", time=2.0, goal=True), (28.0, "28 s")),
        (Verdict(passed=False, message="cut off", margin=0.1, unit="m", cut_off=True), (None, "")),
        (Verdict(passed=False, message="no moment", margin=0.1, unit="m", judged=Judged(0)), (None, "")),
    ],
)
def test_of_goals_the_time_that_is_left_is_drawn_and_nothing_without_a_judgement(
    verdict: Verdict, drawn: tuple[float | None, str], folder: Path
) -> None:
    goal = like(PASSED.expectations[0], verdict=verdict, scope=Scope(end=30.0))
    results_of(like(PASSED, status=verdict.status, expectations=(goal,))).write(_made(folder / "a"))
    (point,) = only(folder).points
    assert (point.value, point.shown) == drawn


def test_only_the_charts_of_broken_scenarios_are_seen_at_once(folder: Path) -> None:
    cut = Verdict(passed=False, message="cut off", margin=0.1, unit="m", time=1.0, cut_off=True)
    good = outcome(0.3)
    bad = outcome(-0.1)
    bad = like(bad, name="bad", expectations=(*bad.expectations, like(bad.expectations[0], name="later", verdict=cut)))
    results_of(good, bad).write(_made(folder / "a"))
    write_history(read_runs([str(folder)]), folder)
    page = (folder / HISTORY_FILE).read_text(encoding="utf-8")
    [shown, folded] = page.split("<article ")[1:]
    assert "<summary>1 expectation</summary>" in folded
    assert "expectations</summary>" not in shown
    # An expectation that was cut off in each run has no rate.
    assert re.findall("(good in 0 of 1 run|never judged)", shown) == ["good in 0 of 1 run", "never judged"]


# Each day has the names of its expectations; a new limit gives a default name another number.
@pytest.mark.parametrize(
    ("days", "broken"), [("1b 2b", ""), ("1b b", ""), ("1b -", "1b"), ("- 1b", ""), ("1b 2b -", "2b")]
)
def test_an_expectation_that_is_not_stated_any_more_is_not_broken(days: str, broken: str, folder: Path) -> None:
    runs = [CRASHED] * len(days.split())
    for day, names in enumerate(days.split()):
        if names != "-":
            one = outcome(1.0 if day else -1.0)
            runs[day] = like(one, expectations=tuple(like(one.expectations[0], name=name) for name in names))
    every = histories(read_runs([str(write(folder, runs))]))
    assert "".join(history.expectation for history in every if history.broken) == broken


def test_a_broken_scenario_that_did_not_run_again_says_so(folder: Path) -> None:
    [line] = write_history(read_runs([str(write(folder, [-0.1, like(PASSED, name="other")]))]), folder)
    assert line.endswith("came to -0.1 m; not run since 0000000 (2026-11-01)")


def _made(place: Path) -> Path:
    place.mkdir(parents=True)
    return place


@pytest.mark.parametrize("kind", sorted(SAMPLES.keys() - {"failed"}))  # it has a scenario twice
def test_any_results_have_a_history(kind: str, folder: Path) -> None:
    """Also of scenarios with several expectations of a name, of gates, and with any text."""
    for name in ("a", "b"):
        SAMPLES[kind].write(_made(folder / name))
    write_history(read_runs([str(folder)]), folder)
    page = (folder / HISTORY_FILE).read_text(encoding="utf-8")
    assert "<script" not in page
    assert "onerror=" not in re.sub(r"&\w+;[^<]*", "", page)


def test_folders_without_results_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no results.json below"):
        read_runs([str(tmp_path)])
    assert call(["report", "a", "b"]) == 2
