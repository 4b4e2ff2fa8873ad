from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from urllib.parse import parse_qs, unquote, urlsplit

import pytest

from sim_action.app.view import address, opened
from sim_action.cli.main import call
from sim_action.core.errors import UsageError
from tests.outcomes import as_former_version, outcome, results, stored


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A run that has left a report."""
    monkeypatch.chdir(tmp_path)
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER", "SIM_ACTION_OUTPUT_DIR", "GITHUB_ACTIONS"):
        monkeypatch.delenv(name, raising=False)
    stored(tmp_path / "sim-results", results(outcome("a b & c.sim.yml"), outcome("d.sim.yml")))
    (tmp_path / "sim-results/report.html").write_text("<!doctype html>")
    return tmp_path / "sim-results"


@pytest.mark.parametrize("place", ["sim-results", "sim-results/report.html", "sim-results/results.json"])
def test_a_report_is_found_by_itself_and_by_what_lies_beside_it(place: str, folder: Path) -> None:
    assert address(Path(place)) == (folder / "report.html").as_uri()


def test_a_moment_of_a_scenario_stands_behind_it(folder: Path) -> None:
    found = urlsplit(address(folder, "a b & c", 4.504))
    assert unquote(found.path) == str(folder / "report.html")
    assert parse_qs(found.fragment) == {"scenario": ["a b & c"], "t": ["4.5"]}


def test_names_are_read_from_results_of_the_former_version(folder: Path) -> None:
    as_former_version(folder / "results.json")
    assert address(folder, "d").endswith("report.html#scenario=d")
    with pytest.raises(UsageError, match="no scenario 'dd'"):
        address(folder, "dd")


def test_a_name_that_is_not_in_it_is_told_with_the_nearest(folder: Path) -> None:
    with pytest.raises(UsageError, match="the report has no scenario 'dd'; did you mean 'd'"):
        address(folder, "dd")
    (folder / "results.json").unlink()
    assert address(folder, "dd").endswith("report.html#scenario=dd")


@pytest.mark.parametrize("there", [2, 1, 0])
def test_a_time_is_of_one_scenario(there: int, folder: Path) -> None:
    results(*[outcome("a.sim.yml"), outcome("b.sim.yml")][:there]).write(folder)
    if there == 1:
        assert address(folder, time=2.0).endswith("#scenario=a&t=2")
        return
    with pytest.raises(UsageError, match="--time needs --only to select a scenario"):
        address(folder, time=2.0)


@pytest.mark.parametrize("place", ["nowhere", "sim-results/traces", "x" * 300, "a\0b"])
def test_a_report_that_is_not_there_is_told_with_what_writes_it(place: str) -> None:
    with pytest.raises(UsageError, match=r"no report found at .*; `sim-action run` writes one"):
        address(Path(place))


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there always is a display")
def test_without_a_display_the_address_is_printed(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    assert call(["view"]) == 0
    told = capsys.readouterr()
    assert told.out == f"{(folder / 'report.html').as_uri()}\n"
    assert "no browser can be opened here" in told.err


@pytest.mark.process
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere BROWSER is not asked")
def test_a_browser_gets_the_address(tmp_path: Path) -> None:
    script = tmp_path / "browser"
    script.write_text(f'#!/bin/sh\necho "$1" > "{tmp_path}/shown"\n')
    script.chmod(0o755)
    code = "import sys, os; from sim_action.app.view import opened; sys.exit(not opened('file:///a#b', os.environ))"
    ran = subprocess.run([sys.executable, "-c", code], env={"BROWSER": f"{script} %s"}, check=False)
    assert ran.returncode == 0
    assert (tmp_path / "shown").read_text() == "file:///a#b\n"
    assert not opened("file:///a#b", {})


def test_only_printed_if_that_is_wanted(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BROWSER", "false")
    assert call(["view", "sim-results", "--only", "d", "--time", "1.25", "--print"]) == 0
    told = capsys.readouterr()
    assert told.out.endswith("report.html#scenario=d&t=1.25\n")
    assert told.err == ""


def test_the_folder_may_stand_in_pyproject(capsys: pytest.CaptureFixture[str], folder: Path, tmp_path: Path) -> None:
    folder.rename(tmp_path / "out")
    (tmp_path / "pyproject.toml").write_text('[tool.sim-action]\noutput-dir = "out"\n')
    assert call(["view", "--print"]) == 0
    assert capsys.readouterr().out == f"{(tmp_path / 'out/report.html').as_uri()}\n"
