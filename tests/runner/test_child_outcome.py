"""What a child's end is said to be, where no child of this machine can end so."""

from __future__ import annotations

import errno
from dataclasses import replace
from pathlib import Path
from typing import Self
from unittest.mock import Mock

import pytest

from sim_action.core.errors import Location
from sim_action.engines import installed
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome
from sim_action.runner.child_outcome import Ending, outcome_of, refusal_of, skipped
from sim_action.runner.isolation.child_process import ChildProcess
from sim_action.runner.job import ChildReport, Job
from sim_action.scenario.loading import load_scenario
from sim_action.state.verdict import Verdict

SCENARIO = "name: n\nrobot: {model: turtlebot3_burger}\nexpect: [upright]\ntime_limit: 1 s\n"


class Gone(ChildProcess):
    """One of Windows, which is over."""

    forks = False
    limits_memory = False

    @classmethod
    def start(cls, job: Job) -> Self:
        return cls(job, -1)

    def poll(self) -> int | None:
        return None

    def kill(self) -> None: ...

    def close(self) -> None: ...

    def _heard(self) -> bytes:
        return b""


@pytest.mark.parametrize(
    ("code", "title", "cause"),
    [
        (0xC0000005, "STATUS_ACCESS_VIOLATION", ": native code crashed"),
        (0xC00000FD, "STATUS_STACK_OVERFLOW", ": native code crashed"),
        (3, "exit 3", "ended by itself, with exit code 3"),
    ],
)
def test_what_windows_ends_is_told_from_what_ends_itself(tmp_path: Path, code: int, title: str, cause: str) -> None:
    (failure,) = outcome_of(child(tmp_path, memory_is_limited=False), code).failures
    assert (failure.kind, failure.title) == ("crash", title)
    assert cause in failure.message


def test_memory_that_is_not_limited_is_not_said_to_be(tmp_path: Path) -> None:
    gone = child(tmp_path, memory_is_limited=False)
    gone.report = ChildReport(output=b"terminate called after throwing an instance of 'std::bad_alloc'\n")
    (failure,) = outcome_of(gone, -6).failures
    assert failure.kind == "memory"
    assert "it needs more memory than this machine has" in failure.message


SCRIPT = "def stand(observation):\n    return None\n"
BY_SCRIPT = SCENARIO.replace("expect:", "commands: {script: ctl.py, function: stand, rate: 10 Hz}\nexpect:")


def child(folder: Path, text: str = SCENARIO, *, memory_is_limited: bool = True) -> Gone:
    (folder / "ctl.py").write_text(SCRIPT)
    (folder / "a.sim.yml").write_text(text)
    loaded = load_scenario(folder / "a.sim.yml")
    return Gone.start(Job(loaded, folder / "t.npz", folder, memory_is_limited=memory_is_limited))


@pytest.mark.parametrize(
    ("text", "why", "line"),
    [
        (SCENARIO, "a limit that is too low", 4),
        (f"wall_limit: 7 s\n{SCENARIO}", "a limit that is too low", 1),
        (BY_SCRIPT, "a stuck controller or a limit that is too low", 5),
    ],
)
def test_a_wall_limit_names_what_may_be_stuck_and_its_key(tmp_path: Path, text: str, why: str, line: int) -> None:
    stuck = child(tmp_path, text)
    (failure,) = outcome_of(stuck, "wall limit").failures
    seconds = stuck.job.loaded.scenario.wall_seconds
    assert (failure.kind, failure.title) == ("wall limit", "wall limit")
    assert failure.message == (
        f"no verdict after {seconds:g} s of wall time (wall_limit): {why}; its last report was at 0.00 s of sim time"
    )
    assert failure.location is not None
    assert failure.location.line == line


@pytest.mark.parametrize(("share", "title"), [(0.5, "wall limit"), (0.9, "too slow")])
def test_a_run_whose_sim_time_moves_on_is_too_slow_and_blames_no_code(tmp_path: Path, share: float, title: str) -> None:
    slow = child(tmp_path, f"wall_limit: 7 s\n{BY_SCRIPT}")
    slow.report = ChildReport(stack_dump=f'Stack:\n  File "{tmp_path}/ctl.py", line 2 in stand\n'.encode())
    slow.sim_time, slow.moved = 0.3, slow.started + share * 7
    (failure,) = outcome_of(slow, "wall limit").failures
    assert (failure.kind, failure.title) == ("wall limit", title)
    assert ("ctl.py:2 did not return" in failure.message) == (title == "wall limit")
    assert ("sim time was still moving on: raise wall_limit" in failure.message) == (title == "too slow")
    assert failure.location is not None
    assert failure.location.line == (2 if title == "wall limit" else 1)


@pytest.mark.parametrize("deleted", [False, True])
def test_a_line_that_did_not_return_is_named(tmp_path: Path, deleted: bool) -> None:
    stuck = child(tmp_path, BY_SCRIPT)
    if deleted:
        (tmp_path / "ctl.py").unlink()
    stack = f'Stack:\n  File "{tmp_path}/ctl.py", line 2 in stand\n'
    stuck.report = ChildReport(stack_dump=stack.encode())
    (failure,) = outcome_of(stuck, "wall limit").failures
    assert f"{tmp_path}/ctl.py:2 did not return or a limit that is too low;" in failure.message
    assert "a stuck controller" not in failure.message
    assert failure.location == Location(f"{tmp_path}/ctl.py", 2)


@pytest.mark.parametrize(
    ("ending", "kind", "title", "message"),
    [
        (
            "output limit",
            "crash",
            "output limit",
            "were printed (output_limit): does a controller print at every step?",
        ),
        (3, "crash", "exit 3", "ended by itself, with exit code 3 and no verdict; its last report was at 0.00 s"),
        (-11, "crash", "SIGSEGV", "was ended by SIGSEGV: native code crashed, in the engine or in a library of the"),
        (-9, "crash", "SIGKILL", "was ended by SIGKILL: it killed itself, or the machine ran out of memory"),
        (-15, "crash", "SIGTERM", "the process of this scenario was ended by SIGTERM; its last report"),
        (-99, "crash", "signal 99", "was ended by signal 99"),
    ],
)
def test_an_end_without_verdict_is_told(tmp_path: Path, ending: Ending, kind: str, title: str, message: str) -> None:
    (failure,) = outcome_of(child(tmp_path, BY_SCRIPT), ending).failures
    assert (failure.kind, failure.title, failure.location) == (kind, title, None)
    assert message in failure.message


@pytest.mark.parametrize(("ending", "short", "kind"), [(-6, 0, "memory"), (-6, 1, "crash"), (-9, 0, "crash")])
def test_a_crash_with_full_memory_is_for_want_of_memory(tmp_path: Path, ending: int, short: int, kind: str) -> None:
    crashed = child(tmp_path)
    # Libraries reserve a quarter of a GiB.
    crashed.peak_memory = crashed.job.loaded.scenario.memory_bytes - (256 << 20) - short
    (failure,) = outcome_of(crashed, ending).failures
    assert failure.kind == kind


def test_a_line_that_called_exit_is_named_only_if_it_is_known(tmp_path: Path) -> None:
    gone = child(tmp_path, BY_SCRIPT)
    gone._take(f"exit 2 {tmp_path}/ctl\x1b.py".encode())
    (failure,) = outcome_of(gone, 7).failures
    assert failure.title == "exit 7"
    assert failure.message.startswith(
        f"{tmp_path}/ctl\\x1b.py:2 called os._exit(7): the process of this scenario ended by itself, with exit code 7"
    )
    assert failure.location == Location(f"{tmp_path}/ctl\\x1b.py", 2)
    (failure,) = outcome_of(gone, -9).failures
    assert "os._exit" not in failure.message
    assert failure.location is None


def test_a_file_that_was_there_before_is_not_that_of_the_run(tmp_path: Path) -> None:
    (tmp_path / "t.npz").write_text("old")
    assert outcome_of(child(tmp_path), -9).trace is None
    gone = child(tmp_path)
    (tmp_path / "t.npz").unlink()
    (tmp_path / "t.npz").write_text("of this run")
    assert outcome_of(gone, -9).trace == "t.npz"


@pytest.mark.parametrize(
    ("left", "told"), [(1, "ended a process that its script left behind"), (3, "ended 3 processes that")]
)
def test_processes_that_were_left_behind_are_counted(tmp_path: Path, left: int, told: str) -> None:
    gone = child(tmp_path)
    gone.left = left
    (failure,) = outcome_of(gone, 3).failures
    assert told in failure.message


@pytest.mark.parametrize("error", [OSError(errno.EMFILE, "Too many open files"), ImportError("no metadata")])
def test_an_outcome_needs_no_file_of_ours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    """It may have no descriptor left; only the version and the provenance are missing then."""
    for name in ("named_version", "engine_provenance"):
        monkeypatch.setattr(f"sim_action.runner.child_outcome.{name}", Mock(side_effect=error))
    found = outcome_of(child(tmp_path), -9)
    assert (found.status, found.engine, found.provenance) == ("error", installed()[0], None)


def test_texts_of_user_code_and_verdicts_are_cut(tmp_path: Path) -> None:
    long = "x" * 100_000
    gone = child(tmp_path)
    failure = Failure(kind="script", title="script error", message=long, location=Location(long, 3), details=long)
    written = Outcome(name="n", file="a.sim.yml", status="error", failures=(failure,), notes=(long,))
    gone.report = ChildReport(outcome=written.model_dump_json().encode())
    found = outcome_of(gone, 0)
    cut = f"{'x' * 1_999}…"
    details = f"{'x' * 19_999}…"
    assert found.failures == (
        failure.model_copy(update={"message": cut, "location": Location(cut, 3), "details": details}),
    )
    assert found.notes == (cut,)
    gone = child(tmp_path)
    (expected,) = gone.job.loaded.scenario.expect
    text = "x" * 100_000
    judged = ExpectationOutcome(
        name=expected.name,
        assertion="upright",
        severity=expected.severity,
        location=expected.location,
        verdict=Verdict(passed=True, unit=text, message=text, body=text, joint=text),
    )
    written = Outcome(name="n", file="a.sim.yml", status="passed", expectations=(judged,))
    gone.report = ChildReport(outcome=written.model_dump_json().encode())
    found = outcome_of(gone, 0)
    assert found.status == "passed"
    assert [len(text) for text in found.expectations[0].verdict.texts] == [2_000] * 4


NO_FILE = "Traceback (most recent call last):\nOSError: [Errno 24] Too many open files: 'a.py'\n"


@pytest.mark.parametrize(
    ("printed", "heard", "ending", "is_refused"),
    [
        (NO_FILE, b"", 1, True),
        # User code may have run, and may print anything.
        (NO_FILE, b"begun\n0.5\n", 1, False),
        (NO_FILE, b"", -9, False),
        (NO_FILE, b"", "wall limit", False),
        (NO_FILE.replace("24", "2"), b"", 1, False),
        ("ImportError: no module named a\n", b"", 1, False),
    ],
)
def test_an_interpreter_that_could_not_open_its_files_has_not_begun(
    tmp_path: Path, printed: str, heard: bytes, ending: Ending, is_refused: bool
) -> None:
    gone = child(tmp_path)
    gone.report = ChildReport(output=printed.encode())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gone, "_heard", lambda: heard)
        gone.listen()
    refusal = refusal_of(gone, ending)
    assert (refusal is not None and refusal.errno == errno.EMFILE) is is_refused


def test_outcomes_have_the_tags_of_their_scenario(tmp_path: Path) -> None:
    gone = child(tmp_path, f"tags: [nightly, slow]\n{SCENARIO}")
    assert skipped(gone.job.loaded).tags == outcome_of(gone, 3).tags == ("nightly", "slow")


def test_a_replay_that_was_not_written_is_not_named(tmp_path: Path) -> None:
    gone = Gone.start(replace(child(tmp_path).job, replay=tmp_path / "n.html"))
    assert outcome_of(gone, -9).replay is None
    (tmp_path / "n.html").write_text("of this run")
    assert outcome_of(gone, -9).replay == "n.html"
