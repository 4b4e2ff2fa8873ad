"""Which golden files a call writes; what they hold is for tests/integration/test_golden_runs.py."""

from __future__ import annotations

from pathlib import Path

from sim_action.core.permissions import Permissions
from sim_action.runner.golden_update import refuse_shared_goldens
from sim_action.runner.run_plan import Plan, engine_runs
from sim_action.scenario.files import read_file
from sim_action.scenario.loading import load_all
from sim_action.scenario.source import Refused, Source
from tests.scenarios import LEAST

UPDATING = Permissions(updates_golden=True)


def plans(folder: Path, *texts: str) -> list[Plan]:
    (folder / ".git").mkdir(exist_ok=True)
    sources: list[Source | Refused] = []
    for number, text in enumerate(texts):
        path = folder / f"{number}.sim.yml"
        path.write_text(text)
        sources += read_file(path, UPDATING)
    loaded = load_all(sources, UPDATING)
    return refuse_shared_goldens([one if isinstance(one, Refused) else engine_runs(one, None) for one in loaded])


def matching(name: str) -> str:
    return LEAST.replace("  - travel", f"  - all_of: [{{matches: {{trace: {name}, position: 1 cm}}}}]\n  - travel")


def refused(folder: Path, *texts: str) -> list[str]:
    return [str(plan.error) for plan in plans(folder, *texts) if isinstance(plan, Refused)]


def test_what_is_traced_and_what_is_refused(tmp_path: Path) -> None:
    # A scenario that matches nothing is left alone.
    [plan] = plans(tmp_path, LEAST)
    assert not isinstance(plan, Refused)
    assert plan[0].scenario.trace.rate is None
    # One that does is traced at every step.
    [plan] = plans(tmp_path, matching("golden/x.csv"))
    assert not isinstance(plan, Refused)
    assert plan[0].scenario.trace.rate == plan[0].scenario.physics.rate


def test_files_of_two_scenarios_that_are_one_are_refused_in_both(tmp_path: Path) -> None:
    found = refused(tmp_path, matching("golden/x.csv"), matching("deep/../golden/x.csv"), matching("golden/y.csv"))
    assert len(found) == 2
    assert all("would be written 2 times" in message for message in found)


def test_a_file_that_no_scenario_varies_into_is_refused(tmp_path: Path) -> None:
    [message] = refused(tmp_path, matching("golden/$variation.csv"))
    assert "the scenario has no variations, so $variation" in message
