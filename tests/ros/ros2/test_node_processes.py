"""Processes of nodes: their output, and their ends."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from sim_action.core.errors import ScriptError
from sim_action.ros.ros2.node_processes import ProcessFolder
from tests.patience import PATIENCE, wait_until

pytestmark = [
    pytest.mark.process,
    pytest.mark.skipif(sys.platform != "linux", reason="nodes are watched by Linux's /proc"),
]

STUBBORN = """\
import os, signal, sys, time
signal.signal(signal.SIGINT, signal.SIG_IGN)
signal.signal(signal.SIGTERM, signal.SIG_IGN)
child = os.fork()
if child:
    print("started", child, flush=True)
time.sleep(600)
"""


def is_there(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_lines_have_the_name_of_their_node(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    folder = ProcessFolder(tmp_path, os.environ)
    talker = folder.start("talker", [sys.executable, "-c", "import sys; print('a'); print('b', file=sys.stderr)"])
    talker.await_end(60)
    assert talker.exit_code() == 0
    assert sorted(talker.text().split()) == ["a", "b"]
    folder.close()
    assert sorted(capfd.readouterr().out.splitlines()) == ["[talker] a", "[talker] b"]


def test_nothing_survives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("_SIGINT_WAIT_S", "_SIGTERM_WAIT_S"):
        monkeypatch.setattr(f"sim_action.ros.ros2.node_processes.{name}", 0.05)
    folder = ProcessFolder(tmp_path, os.environ)
    stubborn = folder.start("stubborn", [sys.executable, "-c", STUBBORN])
    while "started" not in stubborn.text():
        assert stubborn.exit_code() is None
    child = int(stubborn.text().split()[1])
    folder.close()
    assert not is_there(stubborn.pid)
    # It is not our child, so nobody here can wait for its end.
    wait_until(lambda: not is_there(child))
    assert not folder.path.exists()


def test_a_program_that_cannot_be_started(tmp_path: Path) -> None:
    folder = ProcessFolder(tmp_path, os.environ)
    with pytest.raises(ScriptError, match="'ghost' could not be started: No such file or directory"):
        folder.start("ghost", [str(tmp_path / "ghost")])
    script = tmp_path / "script"
    script.write_text("#!/no/such/python\n")
    script.chmod(0o700)
    with pytest.raises(ScriptError, match="its first line names a missing interpreter, '#!/no/such/python'"):
        folder.start("script", [str(script)])
    folder.close()


@pytest.mark.parametrize(("stdin", "said"), [("1.5\nyes\n", "1.5 yes"), ("", "EOFError")])
def test_a_program_reads_the_given_text(stdin: str, said: str, tmp_path: Path) -> None:
    folder = ProcessFolder(tmp_path, os.environ)
    asks = folder.start("asks", [sys.executable, "-c", "print(input(), input())"], stdin=stdin)
    asks.await_end(PATIENCE)
    assert said in asks.text()
    folder.close()
