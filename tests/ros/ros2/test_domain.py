"""Domains that no other process holds or uses."""

from __future__ import annotations

import socket
import sys
from pathlib import Path

import pytest

from sim_action.core.errors import SourceProblem
from sim_action.ros.ros2 import domain
from sim_action.ros.ros2.domain import DOMAINS, Domain

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="nodes are watched by Linux's /proc")


def test_each_has_its_own_until_it_is_closed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(domain, "_used", lambda: iter(number for number in DOMAINS if number not in (5, 6)))
    held = [Domain.free(tmp_path), Domain.free(tmp_path)]
    assert {each.number for each in held} == {5, 6}
    with pytest.raises(SourceProblem, match="all 101 domains of ROS 2 are in use on this machine"):
        Domain.free(tmp_path)
    number = held[0].number
    held[0].close()
    again = Domain.free(tmp_path)
    assert again.number == number
    again.close()
    held[1].close()


def test_ports_in_use_belong_to_domains() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        assert (port - 7400) // 250 in set(domain._used())


def test_a_lock_that_cannot_be_opened_is_passed_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(domain, "_used", lambda: iter(number for number in DOMAINS if number not in (5, 6)))
    (tmp_path / "sim-action-ros2-domain-5.lock").symlink_to(tmp_path / "elsewhere")
    found = Domain.free(tmp_path)
    assert found.number == 6
    assert not (tmp_path / "elsewhere").exists()
    found.close()
