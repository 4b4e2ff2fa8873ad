"""Where a process is when its time is up: noted by itself, found among the user's own files."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

from sim_action.core.errors import Location
from sim_action.runner.stack_dump import note_before, noted_place

ROOT = Path(__file__).parents[2]

# Notes, waits in native code in a thread, and for ever in another function.
STUCK = """\
import sys, threading, time
from pathlib import Path
from sim_action.hang import note_before

def inner():
    while "in <module>" not in Path(sys.argv[1]).read_text():
        pass

note_before(time.monotonic() + 2, Path(sys.argv[1]))
threading.Thread(target=time.sleep, args=(60,), daemon=True).start()
inner()
"""

# Is noted again and again while it makes and leaves frames, faster than they could be read beside it.
BUSY = """\
import sys, time
from pathlib import Path
from sim_action.hang import note_before

def deep(count):
    return count and deep(count - 1)

noted = Path(sys.argv[1])
for _ in range(50):
    note_before(time.monotonic() + 0.02, noted)
    while noted.exists() and "in <module>" not in noted.read_text():
        deep(50)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no signal by which a thread could note itself")
def test_a_process_survives_that_it_is_noted(tmp_path: Path) -> None:
    program = tmp_path / "busy.py"
    program.write_text(BUSY)
    subprocess.run([sys.executable, program, tmp_path / "noted"], env={"PYTHONPATH": str(ROOT)}, check=True, timeout=60)


def test_a_process_notes_where_it_is(tmp_path: Path) -> None:
    program = tmp_path / "st\u00fcck \U0001f916.py"
    program.write_text(STUCK)
    subprocess.run([sys.executable, program, tmp_path / "noted"], env={"PYTHONPATH": str(ROOT)}, check=True, timeout=60)
    place = noted_place((tmp_path / "noted").read_text(), [tmp_path / "other.py", program])
    assert place is not None
    assert place.file == str(program)
    assert place.line in (6, 7)


def test_the_innermost_line_of_the_users_files_counts() -> None:
    text = """\
Timeout (0:00:01)!
Thread 0x0001 (most recent call first):
  File "/usr/lib/python3/select.py", line 9 in poll
  File "/w/helper.py", line 3 in wait
  File "/w/level.py", line 7 in step
  File "/w/level.py", line 70 in judge
"""
    assert noted_place(text, [Path("/w/level.py")]) == Location("/w/level.py", 7)
    assert noted_place(text, [Path("/w/helper.py"), Path("/w/level.py")]) == Location("/w/helper.py", 3)
    assert noted_place(text, [Path("/w/other.py")]) is None
    assert noted_place("", [Path("/w/level.py")]) is None
    assert noted_place('  File "/w/level.py", line ' + "9" * 5000, [Path("/w/level.py")]) is None


def test_of_what_is_late_nothing_is_noted(tmp_path: Path) -> None:
    note_before(time.monotonic() - 1, tmp_path / "noted")
    assert not (tmp_path / "noted").exists()
