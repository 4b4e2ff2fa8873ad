from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.cli.init import write_scaffold
from sim_action.core.errors import UsageError
from sim_action.robot.built_in import BUILT_IN
from sim_action.scenario.loading import load_scenario

ROOT = Path(__file__).parents[2]


def test_the_scenario_is_valid_and_the_schema_is_where_it_says(tmp_path: Path) -> None:
    scenario, schema, workflow = write_scaffold(tmp_path, "{}", force=False)
    assert load_scenario(scenario).warnings == ()
    assert scenario.read_text().splitlines()[0].endswith(f"$schema={schema.name}")
    assert workflow == tmp_path / ".github/workflows/simulation.yml"


@pytest.mark.parametrize("robot", BUILT_IN)
def test_the_scenario_of_each_built_in_robot_is_valid(robot: str, tmp_path: Path) -> None:
    scenario, *_ = write_scaffold(tmp_path, "{}", force=False, robot=robot)
    loaded = load_scenario(scenario)
    assert loaded.warnings == ()
    assert loaded.scenario.robot.model == robot
    comments = [
        line.index("#") for line in scenario.read_text().splitlines() if line.startswith(("  model:", "world:"))
    ]
    assert comments == [32, 32]


def test_a_robot_or_a_folder_that_cannot_be_is_a_usage_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="unknown robot 'husky'; did you mean 'husky_a200'"):
        write_scaffold(tmp_path, "{}", force=False, robot="husky")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match="cannot write"):
        write_scaffold(tmp_path / "file", "{}", force=True)


def test_nothing_is_overwritten_without_force(tmp_path: Path) -> None:
    scenario, *_ = write_scaffold(tmp_path, "{}", force=False)
    scenario.write_text("mine")
    with pytest.raises(UsageError, match="--force"):
        write_scaffold(tmp_path, "{}", force=False)
    assert scenario.read_text() == "mine"
    write_scaffold(tmp_path, "{}", force=True)
    assert scenario.read_text() != "mine"
    # Nothing at all is written if one file is there.
    (tmp_path / "other/simulation").mkdir(parents=True)
    (tmp_path / "other/simulation/scenario.schema.json").touch()
    with pytest.raises(UsageError):
        write_scaffold(tmp_path / "other", "{}", force=False)
    assert not (tmp_path / "other/.github").exists()
