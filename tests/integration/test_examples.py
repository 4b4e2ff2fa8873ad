"""The examples pass, and the tutorial's fails as it should when its robot does not move."""

from __future__ import annotations

import re
import shutil
from functools import partial
from pathlib import Path

import pytest

from sim_action.assertions import ASSERTIONS
from sim_action.engines import installed
from tests import examples
from tests.integration.conftest import fresh_sim_action, outcomes
from tests.integration.conftest import sim_action as warm_sim_action
from tests.ros.ros1.launches import missing_ros
from tests.ros.ros2.nodes import missing_ros as missing_ros2
from tests.soak import soaked

ROOT = Path(__file__).parents[2]


def can_run(text: str) -> bool:
    """Where ROS or a compiler is not, what needs them cannot be run."""
    missing = [key for key, why in (("ros1", missing_ros()), ("ros2", missing_ros2())) if why]
    return not any(f"  {key}:" in text for key in missing) and not (shutil.which("cc") is None and "- cc " in text)


EXAMPLES = [path for path in examples.EXAMPLES if can_run(path.read_text(encoding="utf-8"))]


sim_action = partial(warm_sim_action, COLUMNS="120")
OF_NODES = [path for path in EXAMPLES if re.search(r"^  ros[12]:", path.read_text(encoding="utf-8"), re.MULTILINE)]
# What stands for a part that has a form of its own on each engine.
PARTS = {"commands", "drives", "robots", "sensors", "worlds"}
# Tests of their own run them; test_signals.py those of assertions.
ELSEWHERE = {"assertions", "quadrotor", "quadruped"}
# It takes PyBullet as long as thirty others.
SLOW = "belt_and_arm.sim.yml"


def all_pass(paths: list[Path], engine: str, folder: Path) -> None:
    shutil.copytree(ROOT / "examples", folder / "examples")
    files = [path.relative_to(ROOT).as_posix() for path in paths]
    ran = fresh_sim_action(folder, "run", "--no-report", "--backend", engine, *files)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert {outcome["file"] for outcome in outcomes(folder)} == set(files)
    for outcome in outcomes(folder):
        assert (outcome["status"], outcome["diagnostics"], outcome["warnings"]) == ("passed", [], []), outcome["name"]


WITHOUT_NODES = [path for path in EXAMPLES if path not in OF_NODES]
CHOSEN = {
    "all": WITHOUT_NODES,
    "quick": [path for path in WITHOUT_NODES if path.parent.name not in ELSEWHERE and path.name != SLOW],
    "parts": [path for path in WITHOUT_NODES if path.parent.name in PARTS],
}
SHORT = list(zip(installed(), ("quick", "parts"), strict=False))


@pytest.mark.parametrize(("engine", "which"), soaked([*SHORT, *((engine, "all") for engine in installed())], SHORT))
def test_all_examples_pass_on_every_engine(engine: str, which: str, tmp_path: Path) -> None:
    """Most of them on one engine, and those of parts on the other."""
    all_pass(CHOSEN[which], engine, tmp_path)


@pytest.mark.soak
@pytest.mark.skipif(not OF_NODES, reason="there is no ROS here")
@pytest.mark.parametrize("engine", installed())
def test_examples_with_nodes_of_ros_pass(engine: str, tmp_path: Path) -> None:
    """Nodes of some of them drive in tests/integration/test_ros1.py and test_ros2_examples.py, too."""
    all_pass(OF_NODES, engine, tmp_path)


FOLDERS = sorted({path.relative_to(ROOT).parent.as_posix() for path in EXAMPLES})


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    """A folder with a copy of the examples."""
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    return tmp_path


@pytest.mark.soak
@pytest.mark.parametrize("below", FOLDERS)
def test_every_expectation_notices_something(below: str, copied: Path) -> None:
    below_it = [str(path.relative_to(ROOT)) for path in EXAMPLES if path.parent == ROOT / below]
    ran = fresh_sim_action(copied, "prove", "--strict", *below_it)
    assert ran.returncode == 0, ran.stdout + ran.stderr


def in_failing_form(text: str) -> tuple[str, int]:
    """An example with an assertion that does not hold: what `fails with` says in place of the line above; its line."""
    lines = text.splitlines()
    number = next(index for index, line in enumerate(lines) if line.lstrip().startswith(FAILS_WITH))
    key, _, _ = lines[number - 1].partition(": ")
    lines[number - 1] = f"{key}: {lines[number].lstrip().removeprefix(FAILS_WITH)}"
    return "\n".join(lines) + "\n", number


FAILS_WITH = "# fails with: "


# On the first engine, test_signals.py runs them.
@pytest.mark.parametrize("engine", soaked(installed(), short=installed()[-1:]))
def test_every_assertion_can_fail_on_every_engine(engine: str, copied: Path) -> None:
    expected = {}
    for key in ASSERTIONS:
        name = f"examples/assertions/{key}.sim.yml"
        text, line = in_failing_form((copied / name).read_text())
        (copied / name).write_text(text)
        expected[name] = [(key, line)]
    ran = sim_action(copied, "run", "--backend", engine, *expected)
    assert ran.returncode == 1, ran.stdout + ran.stderr
    for outcome in outcomes(copied):
        failed = [one for one in outcome["expectations"] if not one["verdict"]["passed"]]
        places = [(one["assertion"], one["location"]["line"]) for one in failed]
        assert places == expected.pop(outcome["file"])
    assert not expected


NOT_EXERCISED_WITH = "# not exercised with: "


def in_unexercised_form(text: str) -> str:
    """An example with an expectation that is never judged.

    What `not exercised with` says is in place of the line above if that has the same key, else on a line of its own.
    """
    lines: list[str] = []
    for line in text.splitlines():
        inner = line.replace(NOT_EXERCISED_WITH, "")
        if inner != line:
            above = next((n for n in range(len(lines))[::-1] if not lines[n].lstrip().startswith("#")), 0)
            if lines[above].startswith(f"{inner.partition(': ')[0]}: "):
                del lines[above:]
        lines.append(inner)
    return "\n".join(lines) + "\n"


def test_every_assertion_can_be_left_unexercised(copied: Path) -> None:
    expected = {f"examples/assertions/{key}.sim.yml": key for key in ASSERTIONS}
    for name in expected:
        text = (copied / name).read_text()
        assert NOT_EXERCISED_WITH in text, name
        (copied / name).write_text(in_unexercised_form(text))
    ran = sim_action(copied, "run", "--no-report", *expected)
    assert ran.returncode == 1, ran.stdout + ran.stderr
    for outcome in outcomes(copied):
        judged = [(one["assertion"], one["verdict"]["judged"]["moments"]) for one in outcome["expectations"]]
        assert (expected.pop(outcome["file"]), 0) in judged, outcome
    assert not expected


def test_the_five_minutes_of_the_readme(tmp_path: Path) -> None:
    assert sim_action(tmp_path, "init", "hello").returncode == 0
    passing = sim_action(tmp_path, "run", "hello")
    assert passing.returncode == 0, passing.stdout + passing.stderr
    scenario = tmp_path / "hello/simulation/drive_straight.sim.yml"
    (outcome,) = outcomes(tmp_path)
    assert outcome["warnings"] == []
    text = scenario.read_text()
    assert "pose: {x: 3.0}" in text
    scenario.write_text(text.replace("x: 3.0", "x: 1.0"))
    failing = sim_action(tmp_path, "run", "hello")
    assert failing.returncode == 1
    assert "touched wall" in failing.stdout
    line = next(n for n, line in enumerate(scenario.read_text().splitlines(), start=1) if "- no_collision" in line)
    assert f"hello/simulation/drive_straight.sim.yml:{line}:5" in failing.stdout
    assert sim_action(tmp_path, "validate", "hello").returncode == 0
