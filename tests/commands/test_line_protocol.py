"""Real programs at the other end: lines go out and come back, and whatever else happens has its cause told."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import pytest

from sim_action.commands.line_protocol import MAX_LINE_BYTES, AnswerLimit, LineProcess
from sim_action.core.errors import ScriptError
from tests.patience import PATIENCE, wait_until

pytestmark = pytest.mark.process
LIMIT: Final = AnswerLimit(PATIENCE, "answer_within")
SHORT: Final = AnswerLimit(0.3, "answer_within")
ECHO: Final = "for line in sys.stdin: print(line.strip().upper(), flush=True)"


@contextmanager
def running(program: str, folder: Path) -> Iterator[LineProcess]:
    text = f"import os, signal, sys, time\n{program}"
    lockstep = LineProcess([sys.executable, "-c", text], folder, "ctl")
    try:
        yield lockstep
    finally:
        lockstep.close()


def refusal(program: str, folder: Path, limit: AnswerLimit = LIMIT) -> ScriptError:
    """What is said of the first question at which it fails."""
    with running(program, folder) as lockstep, pytest.raises(ScriptError) as raised:
        ask_often(lockstep, limit)
    return raised.value


def ask_often(lockstep: LineProcess, limit: AnswerLimit) -> None:
    for _ in range(100):
        lockstep.ask(b"question", limit)


def test_each_line_is_answered_by_the_next(tmp_path: Path) -> None:
    with running(ECHO, tmp_path) as lockstep:
        assert [lockstep.ask(question, LIMIT) for question in (b"one", b"two")] == [b"ONE", b"TWO"]
    with running("input(); print(os.getcwd(), flush=True)\ninput()", tmp_path) as lockstep:
        assert lockstep.ask(b"where", LIMIT) == str(tmp_path).encode()
    pieces = "for line in sys.stdin:\n    for c in 'abc\\n': sys.stdout.write(c); sys.stdout.flush(); time.sleep(0.02)"
    with running(pieces, tmp_path) as lockstep:
        assert [lockstep.ask(b"go", LIMIT) for _ in range(2)] == [b"abc", b"abc"]


@pytest.mark.parametrize("length", [10, 200_000, MAX_LINE_BYTES])
def test_lines_of_any_length_come_whole(length: int, tmp_path: Path) -> None:
    with running(ECHO, tmp_path) as lockstep:
        assert lockstep.ask(b"a" * length, LIMIT) == b"A" * length


@pytest.mark.parametrize(
    ("program", "why"),
    [
        ("sys.exit(3)", "exited with code 3 before the end of the run"),
        ("sys.exit('no such sensor')", "exited with code 1 before the end of the run; its last line on standard error"),
        ("raise KeyError('x')", "exited with code 1 before the end of the run; its last line on standard error: KeyEr"),
        ("os.kill(os.getpid(), signal.SIGKILL)", "was killed by SIGKILL"),
        ("input(); os.kill(os.getpid(), signal.SIGSEGV)", "was killed by SIGSEGV"),
        ("input(); os.kill(os.getpid(), signal.SIGRTMIN + 1)", "was killed by signal "),
        ("input(); print('half', end='', flush=True)", "exited with code 0"),
        ("os.close(1); time.sleep(600)", "closed its standard output, but is still running"),
        ("input(); print('x' * 1_000_001, flush=True)\ninput()", "answered with a line of more than 1 MB"),
        ("while True: sys.stdout.write('x' * 65536)", "answered with a line of more than 1 MB"),
        ("while True: print('{}')", "wrote an unexpected line, '{}'; it must answer each line"),
        ("for line in sys.stdin: print('a'); print('b', flush=True)", "wrote an unexpected line, "),
    ],
)
def test_a_program_that_misbehaves_is_told_with_the_cause(program: str, why: str, tmp_path: Path) -> None:
    error = refusal(program, tmp_path)
    assert str(error).startswith("the process 'ctl' ")
    assert why in str(error)


@pytest.mark.parametrize(
    ("program", "why"),
    [
        ("time.sleep(600)", "within 0.3 s of wall time (answer_within); check that it flushes its output after each l"),
        ("out = open(1, 'w')\nfor line in sys.stdin: out.write(line)", "check that it flushes its output after each l"),
        ("input(); print('a', flush=True)\ntime.sleep(600)", "did not answer within 0.3 s of wall time (answer_within"),
        ("signal.signal(signal.SIGTERM, signal.SIG_IGN)\nwhile True: pass", "did not answer within 0.3 s"),
    ],
)
def test_a_program_that_is_silent_is_not_waited_for(program: str, why: str, tmp_path: Path) -> None:
    assert why in str(refusal(program, tmp_path, SHORT))


def test_a_program_that_never_reads_is_not_waited_for(tmp_path: Path) -> None:
    with running("time.sleep(600)", tmp_path) as lockstep, pytest.raises(ScriptError, match="did not answer"):
        lockstep.ask(b"x" * 10_000_000, SHORT)


def test_one_that_has_ended_while_what_it_started_holds_its_output_is_told_so(tmp_path: Path) -> None:
    child = "input()\nif os.fork() == 0: time.sleep(600)\nprint('a', flush=True)\nos._exit(4)"
    with running(child, tmp_path) as lockstep:
        # Until it is about to end, however slow the machine is.
        lockstep.ask(b"x", LIMIT)
        # No test waits for so long: it is told when it is gone.
        with pytest.raises(ScriptError, match="exited with code 4"):
            lockstep.ask(b"y", AnswerLimit(3600.0, "answer_within"))
    # An answer that it left counts.
    child = "input()\nif os.fork() == 0: time.sleep(600)\nprint('a', flush=True)\nos._exit(0)"
    with running(child, tmp_path) as lockstep:
        assert lockstep.ask(b"x", AnswerLimit(3600.0, "answer_within")) == b"a"


def test_lines_that_nobody_asked_for_are_told_at_the_end_at_the_latest(tmp_path: Path) -> None:
    # The second line comes when the input has ended, as late as it can.
    late = "print(input(), flush=True); sys.stdin.read(); print('second', flush=True)"
    with running(late, tmp_path) as lockstep:
        lockstep.ask(b"x", LIMIT)
    assert (lockstep.unasked() or "").startswith(
        "the process 'ctl' wrote more lines than it received, such as 'second'; if they came between its answers"
    )
    with running(ECHO, tmp_path) as lockstep:
        lockstep.ask(b"x", LIMIT)
    assert lockstep.unasked() is None


def test_last_words_are_its_own_and_not_without_end(tmp_path: Path) -> None:
    program = "for n in range(10_000): print('line', n, file=sys.stderr)\nsys.exit(1)"
    error = refusal(program, tmp_path)
    assert error.details.splitlines() == [f"line {n}" for n in range(9980, 10_000)]


def test_its_standard_error_is_passed_on_also_at_the_end(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    with running("print('hello', file=sys.stderr)\n" + ECHO, tmp_path) as lockstep:
        lockstep.ask(b"x", LIMIT)
    assert "hello\n" in capfd.readouterr().err
    with running(ECHO + "\nprint('farewell', file=sys.stderr)", tmp_path) as lockstep:
        lockstep.ask(b"x", LIMIT)
    assert "farewell\n" in capfd.readouterr().err


def is_there(process: int) -> bool:
    try:
        return b"\nState:\tZ" not in b"\n" + Path(f"/proc/{process}/status").read_bytes()
    except OSError:
        return False


@pytest.mark.parametrize(
    "stays",
    [
        "signal.signal(signal.SIGTERM, signal.SIG_IGN)\nwhile True: time.sleep(1)",
        "os.close(0)\ntime.sleep(600)",
        "if child: sys.exit()\ntime.sleep(600)",
    ],
    ids=["ignores the end", "closes its input", "leaves a child"],
)
def test_a_program_that_does_not_leave_is_ended_with_its_group(stays: str, tmp_path: Path) -> None:
    program = "input(); child = os.fork()\nif child: print(os.getpid(), child, flush=True)"
    with running(f"{program}\n{stays}", tmp_path) as lockstep:
        both = list(map(int, lockstep.ask(b"who", LIMIT).split()))
        assert is_there(both[1])
    wait_until(lambda: not any(map(is_there, both)))


def test_what_it_does_to_its_group_does_not_end_us(tmp_path: Path) -> None:
    assert "was killed by SIGKILL" in str(refusal("os.kill(0, signal.SIGKILL)", tmp_path))


def test_what_it_answers_is_quoted_without_what_acts_on_a_terminal(tmp_path: Path) -> None:
    with running(ECHO, tmp_path) as lockstep:
        error = lockstep.refusal(b"\x1b[31m\xff", "it is not JSON")
    assert str(error) == "the process 'ctl' answered '\\x1b[31m\ufffd': it is not JSON"


def test_what_a_silent_program_says_elsewhere_goes_with_the_error(tmp_path: Path) -> None:
    text = "print('waiting for a robot', file=sys.stderr, flush=True)\ninput(); print(flush=True); input(); input()"
    with running(text, tmp_path) as lockstep:
        # It has begun, however slow the machine is.
        lockstep.ask(b"x", LIMIT)
        with pytest.raises(ScriptError, match=r"did not answer within 0\.3 s (?!.*waiting)") as raised:
            lockstep.ask(b"y", SHORT)
    assert raised.value.details == "waiting for a robot"


def test_no_thread_is_left_of_it(tmp_path: Path) -> None:
    before = set(threading.enumerate())
    with running(ECHO, tmp_path) as lockstep:
        lockstep.ask(b"x", LIMIT)
    wait_until(lambda: before.issuperset(threading.enumerate()))


def test_a_program_that_cannot_be_started_is_told(tmp_path: Path) -> None:
    broken = tmp_path / "broken"
    broken.write_bytes(b"\x00\x01 no program")
    broken.chmod(0o700)
    with pytest.raises(
        ScriptError, match=r"'ctl' could not be started: Exec format error; check that its first line names"
    ):
        LineProcess([str(broken)], tmp_path, "ctl")
    broken.write_text("#!/no/such/python\nprint()\n")
    with pytest.raises(ScriptError, match=r"No such file .*: its first line names a missing .*, '#!/no/such/python'"):
        LineProcess([str(broken)], tmp_path, "ctl")
    with pytest.raises(ScriptError, match=r"'x{57}\.\.\.' could not be started: No such file"):
        LineProcess([str(tmp_path / "absent")], tmp_path, "x" * 100)
