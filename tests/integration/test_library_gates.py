"""Gates in `sim_action.run` and `load`, as programs use them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sim_action import GateOutcome, Results, Scenario, load, run
from sim_action.errors import UsageError
from sim_action.parts import Travel

RUNS = 7


def slips(**keys: Any) -> Scenario:
    """A robot that gets no grip on some floors."""
    stated = {
        "name": "slip",
        "robot": {"model": "turtlebot3_burger"},
        "commands": {"rate": 10, "twist": [{"linear": 0.2}]},
        "expect": [Travel(at_least=0.1)],
        "time_limit": 1,
        "variations": {"world.ground.friction": {"uniform": [0.001, 0.5]}},
        "gate": {"passes": {"at_least": "50 %", "confidence": "75 %"}, "runs": RUNS},
        **keys,
    }
    return Scenario(**{key: value for key, value in stated.items() if value is not None})


@pytest.fixture(scope="module")
def results() -> Results:
    return run([slips(), slips(name="alone", variations={"world.ground.friction": [0.5]}, gate=None)])


@pytest.fixture(scope="module")
def gate(results: Results) -> GateOutcome:
    (gate,) = results.gates
    return gate


def test_a_gate_is_one_outcome(results: Results, gate: GateOutcome) -> None:
    assert [each.name for each in results] == ["slip", "alone[friction=0.5]"]
    assert len(results) == 2
    assert results.passed
    assert results[0] is results["slip"] is gate
    assert len(results.runs) == RUNS + 1
    assert repr(results) == "Results(2 passed)"


def test_a_gate_has_its_runs_and_what_they_show(gate: GateOutcome) -> None:
    passed = sum(each.passed for each in gate.runs)
    assert len(gate.runs) == RUNS
    assert gate.passed
    assert 0 < passed < RUNS, "a gate may pass although a run fails"
    assert gate.rate == passed / RUNS
    assert gate.lower is not None
    assert gate.upper is not None
    assert gate.lower < gate.rate < gate.upper
    assert repr(gate) == f"GateOutcome(name='slip', status='passed', passed {passed} of 7 runs)"


def test_a_run_of_a_gate_is_found_by_its_name(results: Results, gate: GateOutcome) -> None:
    last = gate.runs[-1]
    assert results[last.name] is last
    assert last.trace.time.size
    with pytest.raises(KeyError):
        results["slip[friction=9]"]


def test_a_gate_has_no_trace(gate: GateOutcome) -> None:
    with pytest.raises(UsageError, match=r"'slip' is a gate, and has no trace; use that of a run"):
        _ = gate.trace


def test_texts_of_a_gate_show_its_failed_runs(results: Results, gate: GateOutcome) -> None:
    failed = next(each.name for each in gate.runs if not each.passed)
    assert f"{failed.removeprefix('slip')} failed (travelled" in gate.text
    assert gate.text in results.text
    assert "slip" in gate._repr_html_()


def test_loaded_runs_of_a_gate_form_it_again(tmp_path: Path, gate: GateOutcome) -> None:
    (tmp_path / "slip.sim.yml").write_text(slips().to_yaml())
    scenarios = load(tmp_path, allow_outside=True)
    assert {each.gate for each in scenarios} == {"slip"}
    again = run(scenarios, report=False, allow_outside=True)
    assert again.gates[0].statistics == gate.statistics
    failed = next(number for number, each in enumerate(gate.runs) if not each.passed)
    some = run(scenarios[failed], report=False, allow_outside=True)
    assert ([each.status for each in some], some.gates, some.passed) == (["failed"], (), False)


def test_runs_that_are_given_twice_are_no_gate(tmp_path: Path) -> None:
    """Copies of runs say nothing new, and would make a gate too sure."""
    (tmp_path / "slip.sim.yml").write_text(slips().to_yaml())
    scenarios = load(tmp_path, allow_outside=True)
    some = run([*scenarios, *scenarios[:1]], report=False, allow_outside=True)
    assert (len(some), some.gates) == (RUNS + 1, ())
