"""Inputs that nobody has written: refused with their place, or understood, and never a fault.

`python -m tests.fuzz --minutes 15` tries many more.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.__main__ import Found, examine_cases, examine_urdfs, written
from tests.fuzz.cases import KINDS
from tests.fuzz.corpus import CORPUS
from tests.soak import soaked

SEED = 4
CASES = 5  # inputs of each kind


@pytest.mark.pybullet
@pytest.mark.parametrize("count", soaked([60, 400], short=[60]))
def test_models_made_up_by_chance_are_refused_or_understood_alike(count: int, tmp_path: Path) -> None:
    found = Found()
    examine_urdfs(written(tmp_path, SEED, count), found)
    assert found.wrong == {}
    assert sum(found.fates.values()) == count
    assert min(found.fates["taken"], found.fates["refused"]) > count / 4


def test_damaged_files_are_refused_or_understood_and_never_a_fault() -> None:
    found = Found()
    examine_cases([f"{kind}:{SEED}:{number}" for kind in KINDS for number in range(CASES)], found, share=0.1)
    assert found.wrong == {}
    assert found.fates.total() == CASES * len(KINDS)
    assert {"taken", "refused", "taken, run", "refused, run"} <= found.fates.keys()


def test_what_once_found_a_fault_finds_none() -> None:
    found = Found()
    examine_cases(sorted(CORPUS), found, share=1.0)
    assert found.wrong == {}
    assert found.fates.total() == len(CORPUS)
