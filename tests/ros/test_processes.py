"""Processes of a launch, tested on real ones."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sim_action.ros import processes

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="it reads Linux's /proc")

# A parent that starts a child from a thread when it is told to, and another from its main thread.
PARENT = """\
import subprocess, sys, threading
def child(): print(subprocess.Popen(['sleep', '600']).pid, flush=True)
sys.stdin.readline(); child()
ready = threading.Event(); go = threading.Event()
def run():
    go.wait(); child(); ready.set(); threading.Event().wait()
threading.Thread(target=run, daemon=True).start()
sys.stdin.readline(); go.set(); ready.wait()
sys.stdin.readline()
"""


@pytest.mark.process
def test_children_of_all_threads_as_they_come_and_go() -> None:
    command = [sys.executable, "-c", PARENT]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as it:
        assert it.stdin is not None
        assert it.stdout is not None
        looking = processes.ChildProcesses(it.pid)
        assert looking.look() == frozenset()
        started: set[int] = set()
        for _ in range(2):
            it.stdin.write("go\n")
            it.stdin.flush()
            started.add(int(it.stdout.readline()))
            assert looking.look() == started
            assert processes.children(it.pid) == started
        assert processes.descendants(it.pid) == started
        assert started < processes.descendants(os.getpid())
        for pid in started:
            os.kill(pid, 9)
        it.kill()
        it.wait()
        assert looking.look() == frozenset()
        assert processes.descendants(it.pid) == frozenset()


@pytest.mark.process
def test_where_a_test_writes_what_it_found() -> None:
    # What has been called is not there to be read before it runs.
    command = [sys.executable, "-c", "input(print(flush=True))", "--gtest_output=xml:/tmp/a b.xml", "__name:=x"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as it:
        assert it.stdout is not None
        it.stdout.readline()
        assert processes.rostest_result_path(it.pid) == Path("/tmp/a b.xml")
        assert processes.rostest_result_path(os.getpid()) is None
        assert processes.process_name(it.pid) == f"{Path(sys.executable).name} -c"
        it.communicate(b"\n")
    assert processes.rostest_result_path(it.pid) is None
    assert processes.process_name(it.pid) == f"process {it.pid}"


HEAD = '<?xml version="1.0" encoding="utf-8"?>\n'


@pytest.mark.parametrize(
    ("text", "is_whole"),
    [
        (None, False),
        ("", False),
        (HEAD, False),
        (f'{HEAD}<testsuite errors="0" failures="0" name="a" tests="1" time="3">', False),
        (f'{HEAD}<testsuite errors="0" name="a"><testcase name="b"/></testsuite>', True),
        ("<testsuites><testsuite/><testsuite><testcase name='a'/></testsuite>  </testsuites>".rjust(90), True),
    ],
)
def test_a_result_that_is_whole(text: str | None, is_whole: bool, tmp_path: Path) -> None:
    path = tmp_path / "result.xml"
    if text is not None:
        path.write_text(text)
    assert processes.is_result_written(path) is is_whole
