"""`sim-action guide`: its examples are valid and pass, and it names every part in few words."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sim_action import load
from sim_action.app.catalogue import guide
from sim_action.assertions import ASSERTIONS
from sim_action.commands import COMMANDS
from sim_action.sensors import SENSORS
from tests.integration.conftest import sim_action

MAX_WORDS = 6_000
NUMBER_OF_EXAMPLES = 10


def written(folder: Path) -> list[Path]:
    """Write the examples into a folder."""
    (folder / "controller.py").write_text(re.findall(r"```python\n(.*?)```", guide(), re.DOTALL)[0])
    paths = []
    for number, text in enumerate(re.findall(r"```yaml\n(.*?)```", guide(), re.DOTALL)):
        paths.append(folder / f"{number}.sim.yml")
        paths[-1].write_text(text)
    return paths


def test_the_guide_is_short_and_names_every_part() -> None:
    text = guide()
    assert len(text.split()) <= MAX_WORDS
    assert [name for table in (ASSERTIONS, COMMANDS, SENSORS) for name in table if f"**{name}**: " not in text] == []


def test_the_examples_are_valid(tmp_path: Path) -> None:
    paths = written(tmp_path)
    assert len(paths) == NUMBER_OF_EXAMPLES
    assert all(load(path) for path in paths)


@pytest.mark.soak
@pytest.mark.process
def test_the_examples_pass(tmp_path: Path) -> None:
    written(tmp_path)
    ran = sim_action(tmp_path, "run", "--strict", "--no-report", ".")
    assert ran.returncode == 0, ran.stdout
