"""The devices of the node, without ROS."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from tests.ros.ros1.node.without_ros import imported


@pytest.mark.parametrize(
    ("rate", "kept", "is_lost"), [(50.0, 50.0, False), (100.0, 100.0, False), (200.0, 100.0, True)]
)
def test_a_controller_that_publishes_more_often_than_the_clock_ticks_is_a_loss(
    rate: float, kept: float, is_lost: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    losses: list[str] = []
    wiring = SimpleNamespace(lose=losses.append)
    schedule = imported("plugins", monkeypatch).Wiring.controller_schedule(wiring, "arm", rate)
    assert schedule.rate == kept
    assert losses == ["arm/publish_rate is 200: messages are published 100 times per second at most"] * is_lost
