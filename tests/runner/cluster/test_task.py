from __future__ import annotations

from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from sim_action.core.permissions import Permissions
from sim_action.core.records import replace
from sim_action.engines import installed
from sim_action.runner.cluster.address import ClusterAddress
from sim_action.runner.cluster.dask_executor import DaskExecutor
from sim_action.runner.cluster.task import Software, software

HERE = Software("1.2", "abc", "3.11", (("mujoco", "4.0"),), "2.4", "a processor")


def test_equal_software_has_no_differences() -> None:
    assert list(HERE.differences(HERE)) == []
    there = software(installed())
    assert [*there.differences(there), *there.roundings(there)] == []
    assert there.numpy == np.__version__


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
    assert list(there.roundings(HERE)) == []


@pytest.mark.parametrize(
    ("there", "told"),
    [
        (replace(HERE, numpy="1.26"), ["numpy is 1.26, here 2.4"]),
        (replace(HERE, processor="another one"), ["the processor is another one, here a processor"]),
        (
            replace(HERE, numpy="1.26", processor="arm"),
            ["numpy is 1.26, here 2.4", "the processor is arm, here a processor"],
        ),
    ],
)
def test_what_rounds_otherwise_is_named_and_accepted(there: Software, told: list[str]) -> None:
    assert list(there.roundings(HERE)) == told
    assert list(there.differences(HERE)) == []


def test_a_cluster_that_rounds_otherwise_says_what_this_means(capsys: pytest.CaptureFixture[str]) -> None:
    workers = {"tcp://a:1": replace(HERE, numpy="1.26"), "tcp://b:2": replace(HERE, numpy="1.26"), "tcp://c:3": HERE}
    client: Any = Mock(nthreads=lambda: dict.fromkeys(workers, 1), run=lambda *_, **__: workers)
    DaskExecutor(client, ClusterAddress("tcp://s:8786"), {}, HERE, Permissions()).prepare()
    [line] = capsys.readouterr().err.splitlines()
    assert "--cluster: 2 workers: numpy is 1.26, here 2.4; numbers may differ in their last digits" in line
