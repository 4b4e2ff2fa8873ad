"""What a scenario's own process does: nothing twice, and user code leaves it descriptors and a note of its exit."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest

from sim_action.results.outcome import Outcome
from sim_action.runner.child_main import _noted, guarded
from sim_action.runner.job import ChildReport
from tests.robot.bad_models import GOOD

pytestmark = pytest.mark.process
ROOT: Final = Path(__file__).parents[2]
SCENARIO: Final = (
    "name: n\nrobot: {{model: {}, base: fixed}}\nexpect: [upright]\ntime_limit: 0.1 s\nallow: [fixed-base]\n"
)

# Runs the scenario here, and prints how often its model is opened: while it is loaded, and while it runs.
COUNT: Final = """
import os, sys
from pathlib import Path
from sim_action.scenario.loading import load_scenario
from sim_action.runner.job import ChildFiles
from sim_action.runner.job import Job
from sim_action.runner.child_main import run_job, become_child

opened = 0
def count(event, arguments):
    global opened
    opened += event == "open" and str(arguments[0]).endswith(sys.argv[1])
sys.addaudithook(count)
here = Path.cwd()
out = os.dup(1)
loaded = load_scenario(Path("s.sim.yml"))
before = opened
job, files = Job(loaded, here / "trace.npz", here), ChildFiles.in_folder(here)
progress = os.open(os.devnull, os.O_WRONLY)
become_child(files, progress)
run_job(job, files, progress)
os.write(out, f"{before} {opened - before}".encode())
"""

# Runs the scenario here, and writes its motion into a folder that does not exist.
COMPARED: Final = """
import os
from pathlib import Path
from sim_action.scenario.loading import load_scenario
from sim_action.runner.job import ChildFiles
from sim_action.runner.job import Job
from sim_action.runner.child_main import run_job, become_child

here = Path.cwd()
job = Job(load_scenario(Path("s.sim.yml")), here / "trace.npz", here, motion=here / "missing" / "motion.npz")
files, progress = ChildFiles.in_folder(here), os.open(os.devnull, os.O_WRONLY)
become_child(files, progress)
run_job(job, files, progress)
"""


def outcome_of(program: str, folder: Path, *arguments: str) -> tuple[Outcome, bytes]:
    """Return the outcome that a program writes, and its output."""
    command = [sys.executable, "-c", program, *arguments]
    ran = subprocess.run(command, cwd=folder, env={"PYTHONPATH": str(ROOT)}, capture_output=True, check=True)
    return Outcome.model_validate_json(ChildReport((folder / "outcome.json").read_bytes()).verdict), ran.stdout


def times_opened(folder: Path, model: str) -> tuple[int, int]:
    (folder / model).write_text(GOOD)
    (folder / "s.sim.yml").write_text(SCENARIO.format(model))
    outcome, printed = outcome_of(COUNT, folder, model)
    assert outcome.status == "passed"
    loading, running = map(int, printed.split())
    return loading, running


def test_a_model_that_was_checked_is_not_read_again(tmp_path: Path) -> None:
    assert times_opened(tmp_path, "stated.urdf") == (1, 0)


def test_xacro_is_expanded_once_where_it_runs(tmp_path: Path) -> None:
    loading, running = times_opened(tmp_path, "stated.urdf.xacro")
    assert (loading, running) == (1, 1)


def test_a_motion_that_cannot_be_written_costs_no_verdict(tmp_path: Path) -> None:
    (tmp_path / "it.urdf").write_text(GOOD)
    (tmp_path / "s.sim.yml").write_text(SCENARIO.format("it.urdf"))
    outcome, _ = outcome_of(COMPARED, tmp_path)
    assert outcome.status == "passed"
    (note,) = (note for note in outcome.notes if "motion" in note)
    assert note == "motion: no such file or directory; it is not compared with that in another engine"


@pytest.mark.parametrize(
    ("error", "note"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "replay: no space left on device"),
        (MemoryError(), "replay: out of memory"),
        (ValueError("Too large"), "replay: too large"),
        (KeyError("box"), "replay: an internal error of sim-action: KeyError: 'box'; please report it"),
    ],
)
def test_an_error_is_a_note_with_its_reason(error: Exception, note: str) -> None:
    notes: list[str] = []
    with _noted("replay", notes):
        raise error
    assert notes == [note]


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


@pytest.mark.skipif(sys.platform == "win32", reason="there is no such limit")
@pytest.mark.parametrize(
    ("limit", "change", "spare"),
    [(256, "pass", 60), (64, "pass", 14), (256, "resource.setrlimit(resource.RLIMIT_NOFILE, (100, 300))", 60)],
)
def test_after_a_leak_files_can_be_opened(limit: int, change: str, spare: int) -> None:
    program = LEAK.replace("SOFT", str(limit)).replace("CHANGE", change).replace("SPARE", str(spare))
    assert printed(program) == "Too many open files\n"


@pytest.mark.skipif(sys.platform == "win32", reason="os.fork is missing")
@pytest.mark.parametrize(("how", "line"), [("os._exit(3)", "exit 11 <string>\n"), ("os.abort", "")])
def test_a_call_of_exit_is_noted_in_the_process_itself(how: str, line: str) -> None:
    assert printed(EXITS.replace("HOW", how), code=3 if line else 0) == line


def test_afterwards_everything_is_as_before() -> None:
    leave = os._exit
    with guarded(lambda _: None):
        assert os._exit is not leave
    assert os._exit is leave
