from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from sim_action.runner.isolation.process_control import Process, processes

# The parent of the process that prints is gone before it asks to be ended with it.
ORPHAN = """
import os, signal, time
from sim_action.runner.isolation.process_control import end_with_parent

if os.fork() == 0:
    parent = os.getpid()
    if os.fork() == 0:
        while WAITS and os.getppid() == parent:
            time.sleep(0.001)
        end_with_parent(parent, signal.SIGKILL)
        print('alive', flush=True)
        os._exit(0)
    if WAITS:
        os._exit(0)
    os.wait()
"""


@pytest.mark.process
def test_a_process_has_its_number_parent_and_session(tmp_path: Path) -> None:
    # A program's name stands between brackets in the list, whatever is in it.
    program = tmp_path / "a) S 1 (b"
    shutil.copy("/bin/sleep", program)
    sleeper = subprocess.Popen([program, "600"], start_new_session=True)
    try:
        found = {process.number: process for process in processes()}
        assert found[sleeper.pid] == Process(sleeper.pid, os.getpid(), sleeper.pid)
        assert found[os.getpid()].session == os.getsid(0)
    finally:
        sleeper.kill()
        # Until it is reaped, it is there.
        os.waitid(os.P_PID, sleeper.pid, os.WEXITED | os.WNOWAIT)
        assert sleeper.pid in {process.number for process in processes()}
        sleeper.wait()
    assert sleeper.pid not in {process.number for process in processes()}


@pytest.mark.process
@pytest.mark.parametrize("is_gone", [True, False])
def test_a_process_ends_with_a_parent_that_is_gone(*, is_gone: bool) -> None:
    program = ORPHAN.replace("WAITS", str(is_gone))
    # It has standard output to the end, so that this waits for it.
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ran.stdout == ("" if is_gone else "alive\n")
