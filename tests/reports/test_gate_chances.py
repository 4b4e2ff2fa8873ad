"""What robots of known rates get from a gate, before it runs."""

from __future__ import annotations

import io

import pytest

from sim_action.reports.gate_chances import chance_tables, claim_text, gate_listing, print_chances
from sim_action.scenario.variations.gate import Gate
from tests.outcomes import planned_gate, source

EARLY = {"reject": "85 %", "accept": "95 %"}
QUANTILE = {"quantile": {"of": "travel.measured", "q": "5 %", "at_least": "1.4 m"}}


def test_the_table_of_the_worked_example() -> None:
    (table,) = chance_tables([planned_gate(61)])
    assert table.title == "slip: gate of 61 runs, at least 90 % pass with 95 % confidence"
    assert list(table.lines()) == [
        "a robot that is ... good   85 %   90 %   95 %   99 %",
        "passes (59 or more)        0.00   0.05   0.41   0.98",
        "inconclusive               0.69   0.91   0.59   0.02",
        "fails (50 or fewer)        0.30   0.04   0.00   0.00",
    ]


def test_gates_with_equal_claims_share_a_table() -> None:
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
    assert {row[0]: row[3] for row in table.rows} == {
        "passes": "0.96",
        "inconclusive": "0.01",
        "fails": "0.03",
        "mean number of runs": "55",
    }


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


def test_it_is_printed_as_plain_lines() -> None:
    stream = io.StringIO()
    print_chances([planned_gate(61, "slip\x1b[31m\n::error::x")], stream, {})
    lines = stream.getvalue().splitlines()
    assert len(lines) == 5
    assert "\x1b" not in stream.getvalue()
    assert not any(line.startswith("::") for line in lines)


def test_claims_in_words() -> None:
    assert claim_text(Gate.model_validate({"passes": {"at_least": "90 %"}, **QUANTILE})) == (
        "at least 90 % pass with 95 % confidence; 5 % quantile of travel.measured at least 1.4 m with 95 % confidence"
    )


def test_a_line_for_each_gate_of_a_list() -> None:
    runs = [source("a.sim.yml", number) for number in (1, 2)]
    for run in runs:
        object.__setattr__(run, "gate", planned_gate(61))
    told = ["gate slip: at least 90 % pass with 95 % confidence, 61 runs"]
    assert gate_listing([*runs, source("b.sim.yml")]) == told
