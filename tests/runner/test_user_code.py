"""Guards around user code: descriptors are left after a leak, and calls of os._exit are noted."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sim_action.runner.child_main import guarded

ROOT = Path(__file__).parents[2]

LEAK = """\
import os, resource
from sim_action.runner.child_main import guarded

resource.setrlimit(resource.RLIMIT_NOFILE, (SOFT, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
leaked = []
try:
    with guarded(print):
        CHANGE
        while True:
            leaked.append(os.open(os.devnull, os.O_RDONLY))
except OSError as error:
    spare = [os.open(os.devnull, os.O_RDONLY) for _ in range(SPARE)]
    print(error.strerror)
"""

EXITS = """\
import os, sys
from sim_action.runner.child_main import guarded

def say(line):
    print(line.decode(), flush=True)

with guarded(say):
    if os.fork() == 0:
        os._exit(0)
    os.wait()
    HOW
"""


def printed(program: str, *, code: int = 0) -> str:
    ran = subprocess.run(
        [sys.executable, "-c", program], env={"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False
    )
    assert ran.returncode == code, ran.stderr
    return ran.stdout


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="there is no such limit")
@pytest.mark.parametrize(
    ("limit", "change", "spare"),
    [(256, "pass", 60), (64, "pass", 14), (256, "resource.setrlimit(resource.RLIMIT_NOFILE, (100, 300))", 60)],
)
def test_after_a_leak_files_can_be_opened(limit: int, change: str, spare: int) -> None:
    program = LEAK.replace("SOFT", str(limit)).replace("CHANGE", change).replace("SPARE", str(spare))
    assert printed(program) == "Too many open files\n"


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="os.fork is missing")
@pytest.mark.parametrize(("how", "line"), [("os._exit(3)", "exit 11 <string>\n"), ("os.abort", "")])
def test_a_call_of_exit_is_noted_in_the_process_itself(how: str, line: str) -> None:
    assert printed(EXITS.replace("HOW", how), code=3 if line else 0) == line


def test_afterwards_everything_is_as_before() -> None:
    leave = os._exit
    with guarded(lambda _: None):
        assert os._exit is not leave
    assert os._exit is leave
