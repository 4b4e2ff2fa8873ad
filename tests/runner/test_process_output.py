from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Final

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import Location
from sim_action.results.outcome import Diagnostic
from sim_action.runner.process_output import dump_stack_before, place_in_stack_dump, split_output
from tests.patience import PATIENCE

BANNER = "pybullet build time: Jan 29 2025 23:20:52\n"
WARNING = "b3Warning[examples/Importers/ImportURDFDemo/BulletUrdfImporter.cpp,126]:\nNo inertial data for link"
ERROR = "b3Error[examples/Importers/urdf.cpp,9]:\nmissing link"


@pytest.mark.parametrize(
    ("text", "diagnostics", "rest"),
    [
        ("", (), ""),
        ("hello\n", (), "hello"),
        (BANNER, (), ""),
        (f"{BANNER}hello", (), "hello"),
        (WARNING, (("warning", "No inertial data for link"),), ""),
        (WARNING + ERROR, (("warning", "No inertial data for link"), ("error", "missing link")), ""),
        (WARNING + "\n" + WARNING, (("warning", "No inertial data for link"),), ""),
        (f"before {WARNING}\nafter\n", (("warning", "No inertial data for link"),), "before after"),
        ("b3Printf[a.cpp,1]: so it is\n", (("note", "so it is"),), ""),
        ("b3Printf[a.cpp,1]:\n\nafter", (), "after"),
        ("mujoco warning: Nan\nafter", (("warning", "Nan"),), "after"),
        (
            f"before\nmujoco warning: Nan\n{WARNING}\n",
            (("warning", "Nan"), ("warning", "No inertial data for link")),
            "before",
        ),
        ("a mujoco warning: said somebody", (), "a mujoco warning: said somebody"),
        ("b3Warning without a place", (), "b3Warning without a place"),
    ],
)
def test_messages_are_told_from_other_output(text: str, diagnostics: tuple[tuple[str, str], ...], rest: str) -> None:
    found, output = split_output(text)
    assert tuple((diagnostic.level, diagnostic.message) for diagnostic in found) == diagnostics
    assert output == rest


def test_diagnostics_have_an_end() -> None:
    found, _ = split_output("".join(f"b3Warning[a.cpp,1]:\nmessage {n}\n" for n in range(1000)))
    assert len(found) == 50
    assert found[0] == Diagnostic(level="warning", message="message 0")


PIECES = (BANNER, WARNING, ERROR, "b3Printf[a.cpp,1]:", "b3Warning[", "\nmujoco warning: ", "]:", "\n")


@given(st.lists(st.sampled_from(PIECES) | st.text(max_size=8), max_size=12).map("".join))
def test_any_text_is_split(text: str) -> None:
    found, output = split_output(text)
    assert all(diagnostic.message for diagnostic in found)
    assert len(output) <= len(text)


ROOT = Path(__file__).parents[2]

# Notes, waits in native code in a thread, and for ever in another function.
STUCK = """\
import sys, threading, time
from pathlib import Path
from sim_action.runner.process_output import dump_stack_before

def inner():
    dump_stack_before(time.monotonic() + 1, Path(sys.argv[1]))
    while "in <module>" not in Path(sys.argv[1]).read_text():
        pass

threading.Thread(target=time.sleep, args=(60,), daemon=True).start()
inner()
"""

# Is noted again and again while it makes and leaves frames, faster than they could be read beside it.
BUSY = """\
import sys, time
from pathlib import Path
from sim_action.runner.process_output import dump_stack_before

def deep(count):
    return count and deep(count - 1)

noted = Path(sys.argv[1])
for _ in range(50):
    dump_stack_before(time.monotonic() + 0.02, noted)
    while noted.exists() and "in <module>" not in noted.read_text():
        deep(50)
"""


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="there is no signal by which a thread could note itself")
def test_a_process_survives_that_it_is_noted(tmp_path: Path) -> None:
    program = tmp_path / "busy.py"
    program.write_text(BUSY)
    subprocess.run(
        [sys.executable, program, tmp_path / "noted"], env={"PYTHONPATH": str(ROOT)}, check=True, timeout=PATIENCE
    )


@pytest.mark.process
def test_a_process_notes_where_it_is(tmp_path: Path) -> None:
    program = tmp_path / "st\u00fcck \U0001f916.py"
    program.write_text(STUCK)
    subprocess.run(
        [sys.executable, program, tmp_path / "noted"], env={"PYTHONPATH": str(ROOT)}, check=True, timeout=PATIENCE
    )
    place = place_in_stack_dump((tmp_path / "noted").read_text(), [tmp_path / "other.py", program])
    assert place is not None
    assert place.file == str(program)
    assert place.line in (6, 7, 8)


def test_the_innermost_line_of_the_users_files_counts() -> None:
    text = """\
Timeout (0:00:01)!
Thread 0x0001 (most recent call first):
  File "/usr/lib/python3/select.py", line 9 in poll
  File "/w/helper.py", line 3 in wait
  File "/w/level.py", line 7 in step
  File "/w/level.py", line 70 in judge
"""
    assert place_in_stack_dump(text, [Path("/w/level.py")]) == Location("/w/level.py", 7)
    assert place_in_stack_dump(text, [Path("/w/helper.py"), Path("/w/level.py")]) == Location("/w/helper.py", 3)
    assert place_in_stack_dump(text, [Path("/w/other.py")]) is None
    assert place_in_stack_dump("", [Path("/w/level.py")]) is None
    assert place_in_stack_dump('  File "/w/level.py", line ' + "9" * 5000, [Path("/w/level.py")]) is None


def test_of_what_is_late_nothing_is_noted(tmp_path: Path) -> None:
    dump_stack_before(time.monotonic() - 1, tmp_path / "noted")
    assert not (tmp_path / "noted").exists()


PRINTS: Final = """\
import ctypes
from sim_action.runner.process_output import muted

libc = ctypes.CDLL(None)
libc.printf(b"before\\n")
print("and before")
with muted():
    libc.printf(b"inside\\n")
    print("and inside")
libc.printf(b"after\\n")
"""


@pytest.mark.process
@pytest.mark.skipif(sys.platform != "linux", reason="only PyBullet prints with C, and it runs on Linux only")
def test_what_is_muted_is_neither_more_nor_less_than_what_is_printed_in_the_context() -> None:
    # Only without this variable, C keeps printed output in a buffer.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    found = subprocess.run([sys.executable, "-c", PRINTS], env=environment, capture_output=True, text=True, check=True)
    assert sorted(found.stdout.splitlines()) == ["after", "and before", "before"]
