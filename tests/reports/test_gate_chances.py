"""What robots of known rates get from a gate, before it runs."""

from __future__ import annotations

import io

import pytest

from sim_action.reports.gate_chances import chance_tables, claim_text, gate_listing, plan_lines, print_chances
from sim_action.scenario.variations.gate import Gate
from tests.outcomes import planned_gate, source

EARLY = {"reject": "85 %", "accept": "95 %"}
QUANTILE = {"quantile": {"of": "travel.measured", "q": "5 %", "at_least": "1.4 m"}}


def test_tables_of_chances() -> None:
    # The table of the worked example.
    (table,) = chance_tables([planned_gate(61)])
    assert table.title == "slip: gate of 61 runs, at least 90 % pass with 95 % confidence"
    assert list(table.lines()) == [
        "a robot that is ... good   85 %   90 %   95 %   99 %",
        "passes (59 or more)        0.00   0.05   0.41   0.98",
        "inconclusive               0.69   0.91   0.59   0.02",
        "fails (50 or fewer)        0.30   0.04   0.00   0.00",
    ]
    # Gates with equal claims share a table.
    gates = [planned_gate(61, f"slip[mass={mass}]") for mass in range(5)] + [planned_gate(62)]
    first, second = chance_tables(gates)
    assert first.title.startswith("slip[mass=0], slip[mass=1], slip[mass=2] and 2 more: gate of 61 runs")
    assert second.title.startswith("slip: gate of 62 runs")


@pytest.mark.parametrize(
    ("at_least", "rates"),
    [("50 %", ("25 %", "50 %", "75 %", "95 %")), ("99 %", ("98.5 %", "99 %", "99.5 %", "99.9 %")), ("20 %", None)],
)
def test_the_rates_lie_around_the_claim(at_least: str, rates: tuple[str, ...] | None) -> None:
    (table,) = chance_tables([planned_gate(500, passes={"at_least": at_least})])
    assert table.columns == (rates or ("0 %", "20 %", "60 %", "92 %"))


def test_a_test_that_stops_early_has_its_mean_number_of_runs() -> None:
    (table,) = chance_tables([planned_gate(200, stop_early=EARLY)])
    assert "gate of at most 200 runs, 95 % against 85 % with 95 % confidence" in table.title
    assert table.columns == ("85 %", "90 %", "95 %", "99 %")
    rows = {row[0]: row[3] for row in table.rows}
    assert rows == {"passes": "0.96", "inconclusive": "0.01", "fails": "0.03", "mean number of runs": "55"}


@pytest.mark.parametrize(
    ("bound", "runs", "remark"),
    [
        ("at_least", 59, "at least 1.4 m with 95 % confidence: no value of 59 may be below the bound"),
        ("at_least", 93, "at least 1.4 m with 95 % confidence: at most 1 value of 93 may be below the bound"),
        ("at_most", 93, "at most 1.4 m with 95 % confidence: 93 runs cannot show it"),
        ("at_most", 299, "at most 1.4 m with 95 % confidence: no value of 299 may be above the bound"),
        ("at_most", 473, "at most 1.4 m with 95 % confidence: at most 1 value of 473 may be above the bound"),
    ],
)
def test_a_quantile_states_how_many_values_may_lie_beyond_it(bound: str, runs: int, remark: str) -> None:
    share = "5 %" if bound == "at_least" else "99 %"
    (table,) = chance_tables([planned_gate(runs, quantile={"of": "travel.measured", "q": share, bound: "1.4 m"})])
    assert list(table.lines()) == [f"{share} quantile of travel.measured {remark}"]


def test_claims_and_gates_in_lines() -> None:
    # It is printed as plain lines.
    stream = io.StringIO()
    print_chances([planned_gate(61, "slip\x1b[31m\n::error::x")], stream, {})
    lines = stream.getvalue().splitlines()
    assert len(lines) == 5
    assert "\x1b" not in stream.getvalue()
    assert not any(line.startswith("::") for line in lines)
    # Claims in words.
    assert claim_text(Gate.model_validate({"passes": {"at_least": "90 %"}, **QUANTILE})) == (
        "at least 90 % pass with 95 % confidence; 5 % quantile of travel.measured at least 1.4 m with 95 % confidence"
    )
    # A line for each gate of a list.
    runs = [source("a.sim.yml", number) for number in (1, 2)]
    for run in runs:
        object.__setattr__(run, "gate", planned_gate(61))
    told = ["gate slip: at least 90 % pass with 95 % confidence, 61 runs"]
    assert gate_listing([*runs, source("b.sim.yml")]) == told


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


@pytest.mark.parametrize("wish", [0.5, 0.9])
def test_a_robot_that_is_no_better_than_the_claim_never_passes_often(wish: float) -> None:
    *_, last = plan_lines(planned_gate(61), wish, unknown)
    assert last.endswith("is no better than the claim; no number of runs lets it pass reliably.")


def test_the_plan_of_a_rate() -> None:
    # A wish that no number of runs fulfils.
    *_, last = plan_lines(planned_gate(61), 0.9001, unknown)
    assert last == "  A robot that is 90.01 % good does not pass with P = 0.9 at any number of runs up to 10,000."
    # A rate near 100 percent is not shown as 100 percent.
    lines = list(plan_lines(planned_gate(61), 0.99999, unknown))
    (heading,) = (line for line in lines if line.startswith("  runs "))
    assert heading.split()[-4:] == ["99", "%", "99.999", "%"]
    assert lines[-1].startswith("  A robot that is 99.999 % good passes")
    # A refused gate has no chances of its own.
    lines = list(plan_lines(planned_gate(14), 0.97, unknown, is_refused=True))
    assert lines[0].endswith("; 14 runs, too few")
    assert "  >     14          -   0.00   0.00   0.00   0.00   0.00" in lines
    # The time follows from the number of runs.
    lines = list(plan_lines(planned_gate(61), 0.97, lambda runs: f"{2 * runs:g} s"))
    assert "  >     61          2   0.00   0.05   0.41   0.72   0.98   122 s" in lines
    assert lines[-1] == "  A robot that is 97 % good passes with P >= 0.9 at 103 runs, about 206 s."


def test_the_plan_of_a_test_that_stops_early() -> None:
    # The plan of a test that stops early has mean runs.
    planned = planned_gate(100, stop_early=EARLY)
    lines = list(plan_lines(planned, 0.96, lambda runs: f"{runs:.0f} s"))
    assert "  at most    85 %   90 %   95 %   96 %   99 %   mean runs   time" in lines
    assert "  >    100   0.04   0.28   0.87   0.95   1.00          46   46 s" in lines
    assert lines[-1].startswith(
        "  A robot that is 96 % good passes with P >= 0.9 at a limit of 81 runs; it stops after "
    )
    assert lines[-1].endswith("45 on average, about 45 s.")
    # The limit of a test that stops early is the least one.
    # 189 runs have a probability of 0.795, and 190 runs one of 0.802.
    lines = list(plan_lines(planned, 0.93, unknown))
    assert lines[-2].startswith("  A robot that is 93 % good passes with P >= 0.8 at a limit of 190 runs;")
    # A rate between those of the test has no number of runs.
    planned = planned_gate(100, stop_early={"reject": "50 %", "accept": "95 %"})
    *_, last = plan_lines(planned, 0.6, unknown)
    assert last.startswith("  A robot that is 60 % good does not pass with P = 0.9")


def test_the_plan_of_a_quantile_has_the_values_that_may_lie_beyond_it() -> None:
    lines = list(plan_lines(planned_gate(60, quantile=QUANTILE["quantile"]), 0.97, unknown))
    assert lines[-6:] == [
        "        59              0",
        "  >     60              0",
        "        93              1",
        "       124              2",
        "       153              3",
        "       181              4",
    ]
