"""Speeds that change at each step have the same effect as all other commands."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from sim_action.core.lazy_numpy import FloatArray
from sim_action.state.command import JointTargets
from tests import traces
from tests.integration.engines import running

pytest.importorskip("mujoco", reason="mujoco is not installed")

LEFT, RIGHT = "wheel_left_joint", "wheel_right_joint"
STEPS = 30


def driven(commands: Iterable[JointTargets | None]) -> FloatArray:
    with running("mujoco", traces.scene()) as backend:
        backend.advance(0, list(commands))
        return backend.collect().state


def test_the_order_of_joints_makes_no_difference() -> None:
    speeds = [(step / 10, -step / 7) for step in range(STEPS)]
    in_order = [JointTargets(velocity={LEFT: left, RIGHT: right}) for left, right in speeds]
    in_turns = [
        JointTargets(velocity={RIGHT: right, LEFT: left}) if step % 2 else in_order[step]
        for step, (left, right) in enumerate(speeds)
    ]
    assert np.array_equal(driven(in_order), driven(in_turns))


def test_a_limit_that_the_caller_changes_in_place_counts() -> None:
    def limited() -> Iterable[JointTargets]:
        limits = {LEFT: 5.0, RIGHT: 5.0}
        for step in range(STEPS):
            if step == STEPS // 2:
                limits[LEFT] = 1e-3
            yield JointTargets(velocity={LEFT: step, RIGHT: step}, max_effort=dict(limits))

    shared = {LEFT: 5.0, RIGHT: 5.0}
    with running("mujoco", traces.scene()) as backend:
        for step in range(STEPS):
            if step == STEPS // 2:
                shared[LEFT] = 1e-3
            backend.advance(step, [JointTargets(velocity={LEFT: step, RIGHT: step}, max_effort=shared)])
        in_place = backend.collect().state
    assert np.array_equal(in_place, driven(limited()))


@pytest.mark.parametrize(
    "between",
    [
        pytest.param(JointTargets(effort={LEFT: 0.0}), id="effort"),
        pytest.param(JointTargets(position={LEFT: 0.5}), id="position"),
        pytest.param(JointTargets(velocity={LEFT: 2.0}, max_effort={LEFT: 1e-4}), id="limit"),
        pytest.param(JointTargets(velocity={LEFT: 2.0}), id="fewer joints"),
    ],
)
def test_a_ramp_goes_on_after_another_command(between: JointTargets) -> None:
    ramp = [JointTargets(velocity={LEFT: step / 5, RIGHT: step / 5}) for step in range(STEPS)]
    turned = [JointTargets(velocity={RIGHT: step / 5, LEFT: step / 5}) for step in range(STEPS)]
    commands = [*ramp[:10], between, *ramp[10:]]
    assert np.array_equal(driven(commands), driven([*ramp[:10], between, *turned[10:]]))
