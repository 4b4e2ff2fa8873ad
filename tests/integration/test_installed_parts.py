"""Parts of installed packages in real runs, by the command line and by the tests of their authors."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from sim_action.engines import installed
from tests.installed_packages import ASSERTION, ROOT, WOBBLE, install_assertion, install_wobble
from tests.integration.conftest import outcomes, sim_action
from tests.soak import soaked

STILL = """\
name: {name}
robot: {{model: turtlebot3_burger}}
expect: [{{{expect}}}]
duration: 0.1 s
time_limit: 0.2 s
"""


TESTS = ("-q", "-p", "no:cacheprovider", "tests")


def called(folder: Path, site: Path, *arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run the command line where packages are installed in `site`."""
    return sim_action(folder, *arguments, PYTHONPATH=os.pathsep.join((str(ROOT), str(site))), **variables)


@pytest.fixture
def example(tmp_path: Path) -> Path:
    return shutil.copytree(WOBBLE, tmp_path / "wobble")


@pytest.mark.parametrize("engine", soaked(installed(), short=installed()[:1]))
def test_the_example_runs_with_traces_and_the_same_digest_as_without_the_package(
    engine: str, example: Path, tmp_path: Path
) -> None:
    site = install_wobble(tmp_path / "site")
    ran = called(example, site, "run", "--backend", engine, "-j", "2")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    (outcome,) = outcomes(example)
    assert [expected["assertion"] for expected in outcome["expectations"]] == ["travel", "wobble", "sensor"]
    lines = (example / "straight_line.sim.yml").read_text().splitlines()
    theirs = re.compile("wobble:|inclinometer|sensors:|^    rate|^    trace")
    own = [line for line in lines if not theirs.search(line)]
    (example / "straight_line.sim.yml").write_text("\n".join(own))
    assert called(example, tmp_path, "run", "--backend", engine).returncode == 0
    assert outcomes(example)[0]["digest"] == outcome["digest"]


def test_the_tests_of_the_example_pass(example: Path, tmp_path: Path) -> None:
    ran = called(example, install_wobble(tmp_path / "site"), *TESTS, program="pytest")
    assert ran.returncode == 0, ran.stdout


@pytest.mark.parametrize(
    ("old", "new", "recorded"),
    [("return self\n", "raise ValueError('oh')\n", True), ("return Watch()", "raise ValueError('oh')", False)],
)
def test_an_exception_in_a_run_names_the_package_and_the_place(
    old: str, new: str, recorded: bool, tmp_path: Path
) -> None:
    site = install_assertion(tmp_path / "site", "a-still", ASSERTION.replace(old, new))
    (tmp_path / "a.sim.yml").write_text(STILL.format(name="a", expect="still: {}"))
    ran = called(tmp_path, site, "run", "--no-report")
    assert ran.returncode == 1, ran.stdout
    (failure,) = outcomes(tmp_path)[0]["failures"]
    assert (failure["kind"], failure["title"]) == ("script", "package error")
    assert failure["message"].startswith("'still' of a-still 1.0 raised ValueError: oh (a_still.py:")
    assert failure["location"]["line"] == 3
    assert (outcomes(tmp_path)[0]["trace"] is not None) == recorded
    assert len([*(tmp_path / "sim-results").glob("traces/*.npz")]) == recorded


def test_a_package_that_cannot_be_imported_in_the_process_of_a_scenario_is_named(tmp_path: Path) -> None:
    code = f"import os\nif 'MY_KEY' not in os.environ:\n    raise KeyError('MY_KEY')\n{ASSERTION}"
    site = install_assertion(tmp_path / "site", "a-still", code)
    (tmp_path / "a.sim.yml").write_text(STILL.format(name="a", expect="still: {}"))
    ran = called(tmp_path, site, "run", "--no-report", MY_KEY="1")
    assert "Traceback" not in ran.stdout + ran.stderr
    assert "'still' of a-still 1.0 raised KeyError: 'MY_KEY' (a_still.py:3)" in outcomes(tmp_path)[0]["output"]
    ran = called(tmp_path, site, "run", "--no-report", "--pass-env", "MY_KEY", MY_KEY="1")
    assert ran.returncode == 0, ran.stdout
