"""Inputs that nobody has written: refused with their place, or understood, and never a fault.

`python -m tests.fuzz --minutes 15` tries many more.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.__main__ import Found, examine_cases, examine_urdfs, written
from tests.fuzz.cases import KINDS, case
from tests.fuzz.corpus import CORPUS
from tests.soak import soaked

SEED = 4

CASES = 8
"""Inputs of each kind."""


@pytest.mark.pybullet
@pytest.mark.parametrize("count", soaked([100, 400], short=[100]))
def test_models_made_up_by_chance_are_refused_or_understood_alike(count: int, tmp_path: Path) -> None:
    found = Found()
    examine_urdfs(written(tmp_path, SEED, count), found)
    assert found.wrong == {}
    assert sum(found.fates.values()) == count
    assert min(found.fates["taken"], found.fates["refused"]) > count / 4


@pytest.mark.pybullet
def test_what_is_wrong_with_one_is_told_and_the_others_are_looked_at(tmp_path: Path) -> None:
    device = tmp_path / "device.urdf"
    device.symlink_to("/dev/null")
    first, *others = written(tmp_path, SEED, 4)
    found = Found()
    examine_urdfs([first, device, *others], found)
    assert sum(found.fates.values()) == 5
    assert found.wrong.keys() == {str(device)}
    assert "a refusal without a line" in found.wrong[str(device)][0]


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


def test_a_seed_gives_the_same_inputs() -> None:
    for kind in KINDS:
        first, other, again = ([case(kind, seed, number) for number in range(30)] for seed in (1, 2, 1))
        assert first == again
        assert first != other


def test_a_fault_is_found_and_the_others_are_tried() -> None:
    found = Found()
    examine_cases(["golden:1:1", "golden:x:1", "golden:1:2"], found, share=0.0)
    assert found.fates.total() == 3
    assert found.wrong.keys() == {"golden:x:1"}
    assert "ValueError" in found.wrong["golden:x:1"][0]
