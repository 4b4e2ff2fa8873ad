"""The software of workers, compared with that of the caller."""

from __future__ import annotations

import pytest

from sim_action.core.records import replace
from sim_action.engines import installed
from sim_action.runner.cluster.task import Software, software

HERE = Software("1.2", "abc", "3.11", (("mujoco", "4.0"),))


def test_equal_software_has_no_differences() -> None:
    assert list(HERE.differences(HERE)) == []
    assert list(software(installed()).differences(software(installed()))) == []


@pytest.mark.parametrize(
    ("there", "told"),
    [
        (replace(HERE, python="3.12"), ["Python is 3.12, here 3.11"]),
        (replace(HERE, sim_action="1.3", source="def"), ["sim-action is 1.3, here 1.2"]),
        (replace(HERE, source="def"), ["the files of sim-action have the digest def, here abc"]),
        (replace(HERE, engines=(("mujoco", None),)), ["mujoco is missing, here 4.0"]),
        (replace(HERE, engines=(("mujoco", "4.1"),)), ["mujoco is 4.1, here 4.0"]),
    ],
)
def test_every_difference_is_named(there: Software, told: list[str]) -> None:
    assert list(there.differences(HERE)) == told
