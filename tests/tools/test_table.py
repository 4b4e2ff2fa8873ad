"""The table of `make bench` goes on when a measurement is not possible, and names it with the reason."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tools.bench import run
from tools.bench.reporting import opening_command
from tools.bench.table import Goal, Measurement, NotMeasuredError, Ratio, print_table

KEPT = Ratio("a kept bound", 1.0, 1.0, 2)
MISSED = Ratio("a missed bound", 3.0, 1.0, 2)
LAST = Measurement("the last group", lambda: [KEPT])


def ends_with(error: Exception) -> Measurement:
    """A group of two lines; the second cannot be measured."""

    def lines() -> Iterator[object]:
        yield KEPT
        raise error

    return Measurement("a group", lines)


def test_the_table_names_what_is_missing_and_goes_on(capsys: pytest.CaptureFixture[str]) -> None:
    assert print_table([ends_with(NotMeasuredError("Node.js is not installed")), LAST])
    assert capsys.readouterr().out.splitlines() == [
        str(KEPT),
        "     a group: not measured: Node.js is not installed",
        str(KEPT),
    ]


def test_a_package_of_python_that_is_missing_is_no_failure(capsys: pytest.CaptureFixture[str]) -> None:
    assert print_table([ends_with(ModuleNotFoundError("No module named 'av'")), LAST])
    assert "     a group: not measured: No module named 'av'" in capsys.readouterr().out


def test_a_process_that_fails_fails_the_table_after_the_last_line(capsys: pytest.CaptureFixture[str]) -> None:
    error = subprocess.CalledProcessError(7, ["node"], stderr="at line 1\nError: no page\n\n")
    assert not print_table([ends_with(error), LAST])
    assert capsys.readouterr().out.splitlines()[1:] == [
        "FAIL a group: not measured: a process ended with exit code 7: Error: no page",
        str(KEPT),
    ]


def test_an_error_without_a_text_is_named_by_its_type(capsys: pytest.CaptureFixture[str]) -> None:
    assert not print_table([ends_with(AssertionError()), ends_with(subprocess.CalledProcessError(1, ["x"]))])
    told = [line for line in capsys.readouterr().out.splitlines() if line.startswith("FAIL")]
    assert told == [
        "FAIL a group: not measured: AssertionError: AssertionError",
        "FAIL a group: not measured: a process ended with exit code 1: it printed no error",
    ]


def test_a_missed_bound_fails_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert print_table([LAST])
    assert not print_table([Measurement("a group", lambda: [MISSED]), LAST])
    assert "MISS a missed bound: 3.00 (at most 2; 3e+03 ms / 1e+03 ms)" in capsys.readouterr().out


@pytest.fixture
def programs(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """The programs that are installed, by name."""
    installed = {"node": "/bin/node", "chromium": "/bin/chromium"}

    def which(name: str, **_: object) -> str | None:
        return installed.get(name)

    monkeypatch.setattr("shutil.which", which)
    return installed


@pytest.mark.parametrize(
    ("missing", "reason"),
    [
        ("node", "Node.js is not installed"),
        ("chromium", "neither chromium nor google-chrome is installed"),
        (None, "the Node package playwright-core is missing; install it with: npm ci --prefix "),
    ],
)
def test_a_browser_is_not_started_where_something_is_missing(
    missing: str | None, reason: str, programs: dict[str, str], tmp_path: Path
) -> None:
    if missing:
        del programs[missing]
    with pytest.raises(NotMeasuredError, match=reason):
        opening_command(tmp_path)


def test_a_page_is_opened_by_the_browser_that_is_installed(programs: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "node_modules/playwright-core").mkdir(parents=True)
    assert opening_command(tmp_path) == ["/bin/node", str(tmp_path / "tests/opening.mjs"), "/bin/chromium"]


def test_the_whole_table_says_what_this_machine_lacks(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # Each group is replaced by one that needs Node.js: the real ones take minutes.
    real = run.measurements
    missing = ends_with(NotMeasuredError("Node.js is not installed"))
    monkeypatch.setattr(run, "measurements", lambda folder: [Measurement(m.name, missing.lines) for m in real(folder)])
    with pytest.raises(SystemExit) as end:
        run.main()
    assert not end.value.code
    lines = capsys.readouterr().out.splitlines()
    assert "     a report in a browser: not measured: Node.js is not installed" in lines
    assert lines[-1] == "     both engines, for orientation: not measured: Node.js is not installed"


def test_a_goal_in_seconds_is_missed_like_a_ratio(capsys: pytest.CaptureFixture[str]) -> None:
    kept, missed = Goal("set-up", 2.04, 3, "ours 2.0 s; pip 9 s"), Goal("set-up", 3.1, 3, "ours 3.1 s")
    assert print_table([Measurement("set-up", lambda: [kept])])
    assert not print_table([Measurement("set-up", lambda: [kept, missed])])
    assert capsys.readouterr().out.splitlines() == [
        *["ok   set-up: 2.0 s (at most 3 s; ours 2.0 s; pip 9 s)"] * 2,
        "MISS set-up: 3.1 s (at most 3 s; ours 3.1 s)",
    ]
