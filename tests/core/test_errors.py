"""The error tree: exit codes, locations, and how messages quote what users wrote."""

from __future__ import annotations

import errno
import re
from pathlib import Path

import pytest

from sim_action.core import errors
from sim_action.core.errors import ExitCode, InvalidScenario, Location, Problem
from sim_action.core.version import PACKAGE_FOLDER
from sim_action.core.wording import did_you_mean, escaped_line, log_line, nearest, shown


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (errors.SimActionError, 3),
        (errors.UsageError, 2),
        (errors.InvalidScenario, 2),
        (errors.MissingScenario, 2),
        (errors.ModelError, 2),
        (errors.RunError, 1),
        (errors.EngineError, 1),
        (errors.SimulationUnstable, 1),
        (errors.ScriptError, 1),
    ],
)
def test_every_error_has_the_exit_code_that_the_module_draws(error: type[errors.SimActionError], code: int) -> None:
    assert issubclass(error, errors.SimActionError)
    assert error.exit_code == code


@pytest.mark.parametrize(
    ("parts", "stated", "code"),
    [
        ((), {}, 0),
        ((), {"has_scenarios": False}, 5),
        ((), {"has_failed": True}, 1),
        ((), {"is_interrupted": True, "has_scenarios": False}, 130),
        ((0, 1, 2), {}, 2),
        ((1, 3, 2), {"has_failed": True}, 3),
        ((3, 130), {}, 130),
        ((2,), {"is_interrupted": True}, 130),
    ],
)
def test_the_first_of_130_3_2_and_1_is_the_exit_code(
    parts: tuple[int, ...], stated: dict[str, bool], code: int
) -> None:
    assert ExitCode.of_command(parts, **stated) is ExitCode(code)


def test_only_one_function_decides_the_exit_code_of_a_command() -> None:
    ranking = re.compile(r"\b(max|min|sorted)\((?:[^()]|\([^()]*\))*(exit_code\b|ExitCode)|ExitCode\.NO_SCENARIO")
    modules = [path for path in PACKAGE_FOLDER.rglob("*.py") if path != Path(errors.__file__)]
    assert [path.name for path in modules if ranking.search(path.read_text(encoding="utf-8"))] == []


def test_an_invalid_scenario_says_all_its_problems_a_line_each() -> None:
    problems = [Problem(Location("a.yml", 1, 2), "first"), Problem(Location("a.yml", 3, 4), "second")]
    error = InvalidScenario(iter(problems))
    assert error.problems == tuple(problems)
    assert str(error) == "a.yml:1:2: first\na.yml:3:4: second"


def test_near_names_are_offered_with_the_list() -> None:
    assert did_you_mean("travl", ["upright", "travel"]) == "; did you mean 'travel'? (allowed: travel, upright)"
    assert did_you_mean("zzz", ["upright", "travel"]) == " (allowed: travel, upright)"
    assert did_you_mean("zzz", []) == " (allowed: none)"
    assert did_you_mean("wrld", ["world", "base", "world"]) == "; did you mean 'world'? (allowed: base, world)"
    hint = did_you_mean("n77", [f"n{number:02}" for number in range(99)])
    assert hint.startswith("; did you mean 'n77'? (allowed: n00, n01, ")
    assert hint.endswith(" n39, and 59 more)")


def test_which_names_are_near() -> None:
    assert nearest("ur5", ["husky_a200", "ur5e_gripper"]) == "ur5e_gripper"
    assert nearest("ur5", ["ur5e_gripper", "ur5e_with_camera"]) is None
    assert nearest("ur", ["ur5e_gripper"]) is None
    # Of very many names and of long ones not all are compared.
    assert nearest("wheel", (f"x{number}" for number in range(1_000))) is None
    assert nearest("wheel", [*(f"x{number}" for number in range(999)), "wheels"]) == "wheels"
    assert nearest("wheel", [*(f"x{number}" for number in range(1_000)), "wheels"]) is None
    assert (nearest("a" * 200, ["a" * 101]), nearest("a" * 200, ["a" * 100])) == (None, "a" * 100)


@pytest.mark.parametrize(
    ("text", "safe"),
    [
        ("plain, é and 機", "plain, é and 機"),
        ("a\n::error::b", "a\\n::error::b"),
        ("\x1b[31mred", "\\x1b[31mred"),
        ("\u202egpj.exe", "\\u202egpj.exe"),
        ("\ud800", "\\ud800"),
    ],
)
def test_one_line_escapes_what_acts(text: str, safe: str) -> None:
    assert escaped_line(text) == safe


def test_one_line_has_an_end() -> None:
    assert escaped_line("a" * 1_000_000) == "a" * 2000 + "..."


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "nothing"),
        (True, "true"),
        (1.5, "1.5"),
        ("a\nb", "'a\\nb'"),
        ({"a": 1}, "a map of keys"),
        ((1, 2), "a list of 2"),
    ],
)
def test_values_are_shown_as_their_writer_knows_them(value: object, text: str) -> None:
    assert shown(value) == text


def test_a_long_value_is_cut() -> None:
    assert len(shown("x" * 1000)) == 60


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a.sim.yml:1:1: wrong", "a.sim.yml:1:1: wrong"),
        ("::error::a.sim.yml:1:1: wrong", "./::error::a.sim.yml:1:1: wrong"),
        ("  ::error::a", "./  ::error::a"),
        ("a ##[error]b", "a # #[error]b"),
        ("a\n::error::b", "a\\n::error::b"),
    ],
)
def test_a_line_is_no_workflow_command(text: str, line: str) -> None:
    assert log_line(text) == line


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (OSError(errno.EMFILE, "Too many open files", "a.py"), "too many open files: a.py"),
        (OSError(errno.ENOSPC, "No space left on device"), "no space left on device"),
        (MemoryError(), "out of memory"),
    ],
)
def test_what_the_system_refuses_is_no_internal_error(error: Exception, message: str) -> None:
    found = errors.InternalError.of(error)
    assert isinstance(found, errors.SystemRefusal)
    assert found.exit_code == ExitCode.FAILED
    assert (str(found), found.details) == (f"the system refused a request: {message}", "")


def test_other_errors_of_the_system_are_internal_errors() -> None:
    found = errors.InternalError.of(FileNotFoundError(errno.ENOENT, "No such file or directory", "a.py"))
    assert found.exit_code == ExitCode.INTERNAL
    assert "FileNotFoundError" in found.details
