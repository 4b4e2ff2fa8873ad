"""A command that is run so that nothing of it is left."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.patience import PATIENCE, wait_until

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="there is no keeper but on Linux"),
    pytest.mark.process,
]

KEEPER = [sys.executable, "-m", "sim_action.runner.isolation.command_supervisor"]
LEAVES = "(setsid sh -c 'echo $$ > {file}; exec sleep 600' &) ; while [ ! -s {file} ]; do sleep 0.01; done; "


def is_there(file: Path) -> bool:
    try:
        os.kill(int(file.read_text()), 0)
    except ProcessLookupError:
        return False
    return True


def test_it_ends_as_the_command_ends_and_ends_what_that_leaves(tmp_path: Path) -> None:
    file = tmp_path / "left"
    done = subprocess.run([*KEEPER, "sh", "-c", LEAVES.format(file=file) + "exit 7"], check=False)
    assert done.returncode == 7
    assert not is_there(file)


def test_it_ends_as_the_command_ends(tmp_path: Path) -> None:
    assert subprocess.run([*KEEPER, "sh", "-c", "kill -SEGV $$"], check=False).returncode == -signal.SIGSEGV
    told = subprocess.run([*KEEPER, "sh", "-c", "kill -INT $$; sleep 600"], check=False)
    assert told.returncode == -signal.SIGINT
    done = subprocess.run([*KEEPER, "nowhere-to-be-found"], check=False, capture_output=True, text=True)
    assert done.returncode == 127
    assert done.stderr.startswith("nowhere-to-be-found: No such file")


def test_told_to_end_it_ends_all(tmp_path: Path) -> None:
    file, begun = tmp_path / "left", tmp_path / "begun"
    keeper = subprocess.Popen([*KEEPER, "sh", "-c", LEAVES.format(file=file) + f"touch {begun}; sleep 600"])
    wait_until(begun.exists)
    keeper.terminate()
    assert keeper.wait(PATIENCE) == -signal.SIGTERM
    assert not is_there(file)
