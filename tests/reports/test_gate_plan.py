"""The plan of a gate: the numbers of runs with which a good robot passes."""

from __future__ import annotations

import pytest

from sim_action.reports.gate_chances import plan_lines
from tests.outcomes import planned_gate


def unknown(_: float) -> str:
    return ""


def test_the_plan_has_the_numbers_of_runs_at_which_one_more_may_fail() -> None:
    lines = list(plan_lines(planned_gate(61), 0.97, unknown))
    assert lines[0].endswith("at least 90 % pass with 95 % confidence; 61 runs")
    start = lines.index("  probability to pass, by the number of runs and the true rate:") + 1
    assert lines[start : start + 7] == [
        "  runs       may fail   85 %   90 %   95 %   97 %   99 %",
        "        29          0   0.01   0.05   0.23   0.41   0.75",
        "        46          1   0.01   0.05   0.32   0.60   0.92",
        "  >     61          2   0.00   0.05   0.41   0.72   0.98",
        "        76          3   0.00   0.05   0.47   0.81   0.99",
        "        89          4   0.00   0.05   0.54   0.87   1.00",
        "       103          5   0.00   0.05   0.59   0.91   1.00",
    ]
    assert lines[-2:] == [
        "  A robot that is 97 % good passes with P >= 0.8 at 76 runs.",
        "  A robot that is 97 % good passes with P >= 0.9 at 103 runs.",
    ]


def test_a_refused_gate_has_no_chances_of_its_own() -> None:
    lines = list(plan_lines(planned_gate(14), 0.97, unknown, is_refused=True))
    assert lines[0].endswith("; 14 runs, too few")
    assert "  >     14          -   0.00   0.00   0.00   0.00   0.00" in lines


@pytest.mark.parametrize("wish", [0.5, 0.9])
def test_a_robot_that_is_no_better_than_the_claim_never_passes_often(wish: float) -> None:
    *_, last = plan_lines(planned_gate(61), wish, unknown)
    assert last.endswith("is no better than the claim; no number of runs lets it pass reliably.")


def test_a_wish_that_no_number_of_runs_fulfils() -> None:
    *_, last = plan_lines(planned_gate(61), 0.9001, unknown)
    assert last == "  A robot that is 90.01 % good does not pass with P = 0.9 at any number of runs up to 10,000."


def test_a_rate_near_100_percent_is_not_shown_as_100_percent() -> None:
    lines = list(plan_lines(planned_gate(61), 0.99999, unknown))
    (heading,) = (line for line in lines if line.startswith("  runs "))
    assert heading.split()[-4:] == ["99", "%", "99.999", "%"]
    assert lines[-1].startswith("  A robot that is 99.999 % good passes")


def test_the_time_follows_from_the_number_of_runs() -> None:
    lines = list(plan_lines(planned_gate(61), 0.97, lambda runs: f"{2 * runs:g} s"))
    assert "  >     61          2   0.00   0.05   0.41   0.72   0.98   122 s" in lines
    assert lines[-1] == "  A robot that is 97 % good passes with P >= 0.9 at 103 runs, about 206 s."


def test_the_plan_of_a_test_that_stops_early_has_mean_runs() -> None:
    planned = planned_gate(100, stop_early={"reject": "85 %", "accept": "95 %"})
    lines = list(plan_lines(planned, 0.96, lambda runs: f"{runs:.0f} s"))
    assert "  at most    85 %   90 %   95 %   96 %   99 %   mean runs   time" in lines
    assert "  >    100   0.04   0.28   0.87   0.95   1.00          46   46 s" in lines
    assert lines[-1] == (
        "  A robot that is 96 % good passes with P >= 0.9 at a limit of 81 runs; "
        "it stops after 45 on average, about 45 s."
    )


def test_the_limit_of_a_test_that_stops_early_is_the_least_one() -> None:
    """189 runs have a probability of 0.795, and 190 runs one of 0.802."""
    planned = planned_gate(100, stop_early={"reject": "85 %", "accept": "95 %"})
    lines = list(plan_lines(planned, 0.93, unknown))
    assert lines[-2].startswith("  A robot that is 93 % good passes with P >= 0.8 at a limit of 190 runs;")


def test_a_rate_between_those_of_the_test_has_no_number_of_runs() -> None:
    planned = planned_gate(100, stop_early={"reject": "50 %", "accept": "95 %"})
    *_, last = plan_lines(planned, 0.6, unknown)
    assert last.startswith("  A robot that is 60 % good does not pass with P = 0.9")


def test_the_plan_of_a_quantile_has_the_values_that_may_lie_beyond_it() -> None:
    quantile = {"of": "travel.measured", "q": "5 %", "at_least": "1.4 m"}
    lines = list(plan_lines(planned_gate(60, quantile=quantile), 0.97, unknown))
    assert lines[-6:] == [
        "        59              0",
        "  >     60              0",
        "        93              1",
        "       124              2",
        "       153              3",
        "       181              4",
    ]
