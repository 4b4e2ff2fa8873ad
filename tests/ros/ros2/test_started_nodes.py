"""The start of the nodes that a scenario lists."""

from __future__ import annotations

import socket
import sys
import tempfile
from pathlib import Path

import pytest
import yaml

from sim_action.core.errors import SourceProblem
from sim_action.ros.ros2 import started_nodes
from sim_action.ros.ros2.started_nodes import DOMAINS, Domain, parameter_file

linux = pytest.mark.skipif(sys.platform != "linux", reason="nodes are watched by Linux's /proc")


@pytest.mark.parametrize("text", ["1e3", "nan", "infinity", "0x1p3", "yes", "1", "", "a b", "caf\u00e9", "x " * 80])
def test_a_parameter_that_is_a_text_stays_one(text: str) -> None:
    written = parameter_file({"label": text, "labels": [text]})
    assert written.count(': "') + written.count('- "') == 2
    assert yaml.safe_load(written) == {"/**": {"ros__parameters": {"label": text, "labels": [text]}}}


def test_numbers_and_booleans_are_not_quoted() -> None:
    assert parameter_file({"a": {"gains": [1.5, 2.0], "on": True}}) == (
        '"/**":\n  "ros__parameters":\n    "a":\n      "gains":\n      - 1.5\n      - 2.0\n      "on": true\n'
    )


@pytest.fixture
def name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Names of locks that no other test has; only the domains 5 and 6 are not in use."""
    monkeypatch.setattr(started_nodes, "_used", lambda: iter(number for number in DOMAINS if number not in (5, 6)))
    return str(tmp_path)[-80:]


@linux
def test_each_has_its_own_until_it_is_closed(name: str) -> None:
    held = [Domain.free(name), Domain.free(name)]
    assert {each.number for each in held} == {5, 6}
    with pytest.raises(SourceProblem, match="all 101 domains of ROS 2 are in use on this machine"):
        Domain.free(name)
    number = held[0].number
    held[0].close()
    again = Domain.free(name)
    assert again.number == number
    again.close()
    held[1].close()


@linux
def test_a_domain_is_locked_for_processes_with_other_folders_for_temporary_files(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    held = []
    for number in range(2):
        folder = tmp_path / str(number)
        folder.mkdir()
        monkeypatch.setattr(tempfile, "tempdir", str(folder))
        held.append(Domain.free(name))
    assert {each.number for each in held} == {5, 6}
    for each in held:
        each.close()


@linux
def test_ports_in_use_belong_to_domains() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        assert (port - 7400) // 250 in set(started_nodes._used())
