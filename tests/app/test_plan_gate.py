from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.app.plan_gate import gate_plans, is_plannable, wished_rate
from sim_action.core.errors import UsageError
from sim_action.core.permissions import Permissions
from sim_action.scenario.files import read_file
from sim_action.scenario.source import Refused, Source
from tests.outcomes import gate_results, outcome, planned_gate, runs_of_gate
from tests.scenarios import LEAST

GATED = f"""{LEAST}
variations:
  world.ground.friction: {{uniform: [0.1, 0.9]}}
gate:
  passes: {{at_least: 90 %}}
  runs: RUNS
"""


def read(folder: Path, text: str) -> list[Source | Refused]:
    path = folder / "slip.sim.yml"
    path.write_text(text, encoding="utf-8")
    return list(read_file(path, Permissions()))


@pytest.mark.parametrize("text", ["97%", "97 %", "0.97"])
def test_a_wished_rate(text: str) -> None:
    assert wished_rate(text) == 0.97


@pytest.mark.parametrize("text", ["slip.sim.yml", "120%", "0 %", "100%", "97 m", "nan", ""])
def test_a_bad_rate_is_one_line(text: str) -> None:
    with pytest.raises(UsageError, match="such as --plan-gate 97%") as found:
        wished_rate(text)
    assert "\n" not in str(found.value)


def test_a_gate_with_too_few_runs_is_planned_all_the_same(tmp_path: Path) -> None:
    scenarios = read(tmp_path, GATED.replace("RUNS", "14"))
    assert isinstance(scenarios[0], Refused)
    assert is_plannable(scenarios[0])
    lines = gate_plans(scenarios, 0.97, tmp_path, 2)
    assert lines[0].endswith("at least 90 % pass with 95 % confidence; 14 runs, too few")
    assert any(line.startswith("        29          0") for line in lines)


def test_problems_of_other_scenarios_are_left_to_the_caller(tmp_path: Path) -> None:
    scenarios = read(tmp_path, "name: x\nvariations: 3\n")
    assert not is_plannable(scenarios[0])
    assert gate_plans(scenarios, 0.97, tmp_path, 2) == []


def test_paths_without_a_gate_are_a_mistake(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no scenario in these paths has a gate; add one"):
        gate_plans(read(tmp_path, LEAST), 0.97, tmp_path, 2)


def test_combinations_of_listed_values_have_one_plan(tmp_path: Path) -> None:
    text = GATED.replace("RUNS", "29").replace("variations:\n", "variations:\n  time_limit: [20 s, 30 s]\n")
    scenarios = read(tmp_path, text)
    assert len(scenarios) == 58
    lines = gate_plans(scenarios, 0.97, tmp_path, 2)
    assert [line.split("  ")[0] for line in lines if "slip.sim.yml:" in line] == ["burger drives straight"]


@pytest.mark.parametrize(("jobs", "time"), [(1, "61 s"), (2, "30 s"), (100, "1 s")])
def test_the_time_comes_from_an_earlier_run(tmp_path: Path, jobs: int, time: str) -> None:
    scenarios = read(tmp_path, GATED.replace("RUNS", "61"))
    (tmp_path / "out").mkdir()
    planned = planned_gate(61).model_copy(update={"file": str(tmp_path / "slip.sim.yml")})
    runs = [
        # An early stop left half of the runs out.
        run.model_copy(update={"group": "burger drives straight", "wall_time": 0.0 if run.status == "skipped" else 1.0})
        for run in runs_of_gate(planned, passed=30, failed=1, skipped=30)
    ]
    written = gate_results(planned, *runs, outcome("other.sim.yml", wall_time=100.0))
    written.write(tmp_path / "out")
    lines = gate_plans(scenarios, 0.97, tmp_path / "out", jobs)
    (row,) = [line for line in lines if line.startswith("  >     61")]
    assert row.split("   ")[-1].strip() == time
