"""Whatever is done to a scenario's text: it is loaded, or refused with a place inside the file. Nothing else."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import InvalidScenario, Location, Problem
from sim_action.scenario.loading import load_scenario
from sim_action.scenario.model import LoadedScenario
from tests.fuzz.damage import damaged, structure_damaged
from tests.scenarios import FULL, LEAST
from tests.soak import examples

WORDS = ("twist", "travel", "rate", "name", "linear", "for", "x", "box", "drive", "reach", "stay_within", "joint")
"""Keys in the place of another one."""

texts = st.sampled_from([LEAST, FULL])
seeds = st.integers(0, 2**32 - 1)


def check(data: bytes, folder: Path) -> None:
    path = folder / "any.sim.yml"
    path.write_bytes(data)
    lines = re.split("\r\n|[\r\n\x85\u2028\u2029]", data.decode("utf-8", "replace"))
    for problem in refused(path):
        where = problem.location
        assert where.file == str(path)
        assert where.line is not None
        assert where.column is not None
        assert 1 <= where.line <= len(lines)
        assert 1 <= where.column <= len(lines[where.line - 1]) + 1
        assert problem.message.isprintable()
        assert len(problem.message) < 2100


def refused(path: Path) -> tuple[Problem, ...]:
    """The problems of a file, none if it is valid; any other exception is the bug that is looked for."""
    try:
        loaded = load_scenario(path)
    except InvalidScenario as error:
        return error.problems or (Problem(Location("no problem is told"), ""),)
    assert isinstance(loaded, LoadedScenario)
    return ()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("scenarios")


@examples(100)
@given(texts, seeds)
def test_a_damaged_scenario_is_loaded_or_refused(folder: Path, text: str, seed: int) -> None:
    check(damaged(text.encode(), random.Random(seed)), folder)


@examples(80)
@given(texts, seeds)
def test_any_structure_at_any_key_is_loaded_or_refused(folder: Path, text: str, seed: int) -> None:
    data = structure_damaged(yaml.safe_load(text), random.Random(seed), WORDS)
    check(yaml.dump(data, allow_unicode=True).encode("utf-8", "surrogatepass"), folder)


@examples(80)
@given(st.text(max_size=100))
def test_any_text_is_loaded_or_refused(folder: Path, text: str) -> None:
    check(text.encode("utf-8", "surrogatepass"), folder)
