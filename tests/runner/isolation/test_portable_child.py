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


def test_a_process_that_cannot_be_listened_to_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse() -> None:
        raise OSError(errno.EMFILE, "Too many open files")

    (tmp_path / "a.sim.yml").write_text(SCENARIO)
    job = Job(load_scenario(tmp_path / "a.sim.yml"), tmp_path / "t.npz", tmp_path)
    monkeypatch.setattr(subprocess, "Popen", Started)
    monkeypatch.setattr(socket, "socketpair", refuse)
    with pytest.raises(OSError, match="Too many open files"):
        PortableChild.start(job)
    assert done == ["started", "killed", "reaped"]


def test_a_process_without_a_thread_that_listens_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    (tmp_path / "a.sim.yml").write_text(SCENARIO)
    job = Job(load_scenario(tmp_path / "a.sim.yml"), tmp_path / "t.npz", tmp_path)
    monkeypatch.setattr(subprocess, "Popen", Started)
    pair = socket.socketpair()
    monkeypatch.setattr(socket, "socketpair", lambda: pair)
    monkeypatch.setattr(threading.Thread, "start", refuse)
    with pytest.raises(OSError, match=os.strerror(errno.EAGAIN)):
        PortableChild.start(job)
    assert done == ["started", "killed", "reaped"]
    assert [each.fileno() for each in pair] == [-1, -1]
