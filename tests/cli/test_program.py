"""`sim-action` without a command."""

from __future__ import annotations

import pytest

from sim_action.cli.main import call
from sim_action.core.errors import ExitCode


def test_without_a_command_the_help_is_the_message_of_a_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["--help"]) == ExitCode.PASSED
    help_ = capsys.readouterr().out
    assert help_.startswith("Usage: sim-action [OPTIONS] COMMAND [ARGS]...\n\n")
    assert call([]) == ExitCode.INVALID
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("", help_)
