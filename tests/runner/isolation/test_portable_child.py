"""A child in an interpreter of its own, on systems that refuse what it needs."""

from __future__ import annotations

import errno
import io
import os
import socket
import subprocess
import threading
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from sim_action.runner.isolation.portable_child import PortableChild
from sim_action.runner.job import Job
from sim_action.scenario.loading import load_scenario

SCENARIO = "name: n\nrobot: {model: turtlebot3_burger}\nexpect: [upright]\ntime_limit: 1 s\n"


class Started:
    """A process that was started, in name only."""

    def __init__(self, *_: Any, **options: Any) -> None:
        self.stdin = self.stdout = io.BytesIO()
        done.clear()
        done.append("started")

    def kill(self) -> None:
        done.append("killed")

    def wait(self) -> None:
        done.append("reaped")


done: list[str] = []


@pytest.mark.parametrize("refused", ["socket", "thread"])
def test_a_process_that_is_not_heard_is_ended(refused: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.sim.yml").write_text(SCENARIO)
    job = Job(load_scenario(tmp_path / "a.sim.yml"), tmp_path / "t.npz", tmp_path)
    monkeypatch.setattr(subprocess, "Popen", Started)
    pair, error = socket.socketpair(), OSError(errno.EMFILE, "Too many open files")
    monkeypatch.setattr(
        socket, "socketpair", Mock(return_value=pair, side_effect=error if refused == "socket" else None)
    )
    if refused == "thread":
        monkeypatch.setattr(threading.Thread, "start", Mock(side_effect=RuntimeError("can't start new thread")))
    with pytest.raises(OSError, match="Too many" if refused == "socket" else os.strerror(errno.EAGAIN)):
        PortableChild.start(job)
    assert done == ["started", "killed", "reaped"]
    if refused == "thread":
        assert [each.fileno() for each in pair] == [-1, -1]
    for each in pair:
        each.close()
