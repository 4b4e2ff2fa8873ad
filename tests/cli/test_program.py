from __future__ import annotations

import errno
import sys
from pathlib import Path
from types import ModuleType

import pytest

from sim_action.cli import SUBCOMMANDS
from sim_action.cli.main import call, leave_out_plugins, program
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


def test_help_breaks_no_option_or_package_at_a_hyphen(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    for name in SUBCOMMANDS:
        assert call([name, "--help"]) == ExitCode.PASSED
        help_ = capsys.readouterr().out
        assert help_.isascii()
        assert not [line for line in help_.splitlines() if line.endswith("-")]


LOADER = "pydantic.plugin._loader"


def test_pydantic_finds_no_plugins_unless_it_needs_its_own_loader(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, LOADER, raising=False)
    leave_out_plugins()
    loader = sys.modules[LOADER]
    assert vars(loader)["get_plugins"]() == ()
    assert not hasattr(loader, "__path__")
    assert sys.modules[LOADER] is loader
    monkeypatch.delitem(sys.modules, LOADER, raising=False)
    leave_out_plugins()
    loader = sys.modules[LOADER]
    assert loader.PYDANTIC_ENTRY_POINT_GROUP == "pydantic"
    assert sys.modules[LOADER] is not loader
    used = ModuleType(LOADER)
    monkeypatch.setitem(sys.modules, LOADER, used)
    leave_out_plugins()
    assert sys.modules[LOADER] is used


LONG = "x" * 5000
DEEP = "x/" * 3000


@pytest.mark.parametrize("name", [LONG, DEEP])
@pytest.mark.parametrize(
    "arguments",
    ["run -q", "validate", "matrix --shards 2", "merge -q", "compare old", "inspect", "view --print", "init"],
)
def test_a_name_that_is_too_long_is_no_internal_error(
    arguments: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    code = call([*arguments.split(), name])
    printed = capsys.readouterr()
    assert "Traceback" not in printed.out + printed.err
    assert code in ((0, 2) if arguments.startswith("matrix") else (2, 5))


@pytest.mark.parametrize(("typed", "meant"), [("out/report.html", "out"), ("results.json", ".")])
def test_a_file_is_refused_and_its_folder_is_named(
    typed: str, meant: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path(typed).parent.mkdir(exist_ok=True)
    Path(typed).touch()
    assert call(["report", typed]) == 2
    assert capsys.readouterr().err == (
        f"sim-action: expected the output folder of a run, found the file '{typed}'; name '{meant}'\n"
    )
