"""`sim-action` without a command."""

from __future__ import annotations

import errno

import pytest

from sim_action.cli.main import call, program
from sim_action.core.errors import ExitCode


def test_without_a_command_the_help_is_the_message_of_a_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["--help"]) == ExitCode.PASSED
    help_ = capsys.readouterr().out
    assert help_.startswith("Usage: sim-action [OPTIONS] COMMAND [ARGS]...\n\n")
    assert call([]) == ExitCode.INVALID
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("", help_)


@pytest.mark.parametrize("github", ["", "true"])
def test_what_the_system_refuses_is_one_line_and_no_traceback(
    github: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refused(*_: object, **__: object) -> None:
        raise OSError(errno.EMFILE, "Too many open files", "a.py")

    monkeypatch.setenv("GITHUB_ACTIONS", github)
    monkeypatch.setattr(program, "main", refused)
    assert call(["validate"]) == ExitCode.FAILED
    (line,) = capsys.readouterr().err.splitlines()
    assert "the system refused a request: too many open files: a.py" in line
