"""This machine's processes, found among all others."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from sim_action.runner.isolation.process_control import Process, processes


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
