"""Names of engines in places that cannot read the table: they are those of the table."""

from __future__ import annotations

import ast
import re
import tomllib
from importlib.util import find_spec
from pathlib import Path
from typing import get_args

import pytest
import yaml

from sim_action import engines
from sim_action.engines import ENGINES, AutoOrEngine, EngineName, EngineOrAll

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
NAMES = tuple(ENGINES)


def test_the_types_have_the_names_of_the_table() -> None:
    assert get_args(EngineName) == NAMES
    assert get_args(AutoOrEngine) == ("auto", *NAMES)
    assert get_args(EngineOrAll) == (*NAMES, "all")


def test_type_checkers_read_the_names_of_the_table() -> None:
    written = ast.unparse(ast.parse(Path(engines.__file__).read_text(encoding="utf-8")))
    assert f"EngineName = Literal{list(NAMES)}" in written


@pytest.mark.parametrize("action", ["action.yml", "prove/action.yml", "rostest/action.yml"])
def test_actions_describe_every_engine(action: str) -> None:
    described = yaml.safe_load((ROOT / action).read_text(encoding="utf-8"))["inputs"]["backend"]["description"]
    assert set(re.findall(r"`(\w+)`", described)) - {"all", "backend"} <= set(NAMES)
    assert all(f"`{name}`" in described for name in NAMES)


def test_the_plugin_of_pytest_offers_every_engine() -> None:
    text = (ROOT / "plugins/pytest-sim-action/pytest_sim_action.py").read_text(encoding="utf-8")
    assert f"_BACKENDS: Final = {(*NAMES, 'all')}".replace("'", '"') in text


@pytest.mark.parametrize("name", ENGINES)
def test_an_engine_is_packaged(name: str) -> None:
    engine = ENGINES[name]
    [requirement, *_] = PROJECT["project"]["optional-dependencies"][name]
    assert requirement.startswith(engine.distribution)
    forbidden = [contract.get("forbidden_modules", ()) for contract in PROJECT["tool"]["importlinter"]["contracts"]]
    assert any(engine.package in modules for modules in forbidden)


@pytest.mark.parametrize("name", ENGINES)
def test_a_row_is_about_its_own_folder(name: str) -> None:
    engine = ENGINES[name]
    assert engine.path.startswith(f"sim_action.engines.{name}.")
    for module in engine.feature_modules.values():
        assert find_spec(f"sim_action.{module}")
