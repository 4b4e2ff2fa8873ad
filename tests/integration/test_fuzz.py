"""URDFs that nobody has written: refused with their line, or understood alike by sim-action and the engine.

`python -m tests.fuzz_urdf --minutes 15` looks at many more.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz_urdf import Found, examine, written

pytestmark = pytest.mark.pybullet

COUNT = 400
SEED = 4


def test_models_made_up_by_chance_are_refused_or_understood_alike(tmp_path: Path) -> None:
    found = Found()
    examine(written(tmp_path, SEED, COUNT), found)
    assert found.wrong == {}
    assert sum(found.fates.values()) == COUNT
    assert min(found.fates["taken"], found.fates["refused"]) > COUNT / 4


def test_what_is_wrong_with_one_is_told_and_the_others_are_looked_at(tmp_path: Path) -> None:
    device = tmp_path / "device.urdf"
    device.symlink_to("/dev/null")
    first, *others = written(tmp_path, SEED, 4)
    found = Found()
    examine([first, device, *others], found)
    assert sum(found.fates.values()) == 5
    assert found.wrong.keys() == {device}
    assert "a refusal without a line" in found.wrong[device][0]
