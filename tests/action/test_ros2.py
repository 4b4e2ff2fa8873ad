"""The ROS 2 that the action uses: that of the runner, else the wheels of a distribution."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from action import environment, ros2
from action.lock import entries
from action.ros2 import LOCKS, install, look, main, messages
from sim_action.core.errors import UsageError
from sim_action.ros.ros2 import installation
from sim_action.ros.ros2.installation import DISTRIBUTIONS, WHEELS
from tests.ros.ros2.prefixes import HUMBLE, KILTED, ros_prefix
from tests.ros.ros2.test_preparation import interfaces

FOLDER = Path(__file__).parents[2] / "action/locks"


def variables(temp: Path, wanted: str, **more: str) -> dict[str, str]:
    machine = {"RUNNER_OS": "Linux", "RUNNER_ARCH": "X64", "RUNNER_TEMP": str(temp), "INPUT_CACHE": "false"}
    return {**machine, "INPUT_ROS2": wanted, **more}


@pytest.fixture(autouse=True)
def without_installed_ros(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A ROS 2 of this machine does not count."""
    find = installation.find_ros
    monkeypatch.setattr(ros2, "find_ros", lambda environment: find(environment, tmp_path / "no root"))


def test_each_distribution_has_its_lock_file() -> None:
    assert tuple(LOCKS) == tuple(WHEELS)
    assert set(WHEELS) < set(DISTRIBUTIONS)


@pytest.mark.parametrize("distribution", WHEELS)
def test_what_users_install_is_what_is_locked(distribution: str) -> None:
    stated = (FOLDER.parents[1] / f"tools/ros2/{distribution}.in").read_text(encoding="utf-8").splitlines()
    assert tuple(line for line in stated if not line.startswith("#")) == WHEELS[distribution]
    locked = entries((FOLDER / LOCKS[distribution]).read_text(encoding="utf-8"))
    assert {name.partition("[")[0] for name in WHEELS[distribution]} <= {entry.name for entry in locked}
    assert all(entry.hashes for entry in locked)


@pytest.mark.parametrize(("wanted", "lock"), [("true", "jazzy"), ("jazzy", "jazzy"), ("kilted", "kilted")])
def test_without_ros_the_wheels_are_installed(wanted: str, lock: str, tmp_path: Path) -> None:
    found = look(FOLDER, variables(tmp_path, wanted))
    assert (found["lock"], found["cache"]) == (FOLDER / LOCKS[lock], False)
    assert environment.Plan.parse(str(found["plan"])).ready == ""


def test_wheels_are_cached_as_those_of_other_packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    keys = {
        str(look(FOLDER, variables(tmp_path, wanted, INPUT_CACHE="true", GITHUB_WORKSPACE=str(tmp_path)))["key"])
        for wanted in LOCKS
    }
    assert len(keys) == 2
    assert all(key.startswith("sim-action-Linux-X64-") for key in keys)


@pytest.mark.parametrize("wanted", ["true", "kilted"])
def test_the_ros_of_the_runner_is_used(wanted: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    prefix = ros_prefix(tmp_path / "kilted", KILTED)
    # Such as a container on a runner that has no wheels.
    found = look(FOLDER, variables(tmp_path, wanted, AMENT_PREFIX_PATH=str(prefix), RUNNER_ARCH="ARM64"))
    assert found == {"lock": "", "cache": False}
    assert capsys.readouterr().out.startswith(f"ROS 2: kilted in {prefix} (from the sourced environment), Fast DDS")


@pytest.mark.parametrize("version", [HUMBLE, KILTED])
def test_a_named_distribution_is_installed_although_the_runner_has_another_one(version: str, tmp_path: Path) -> None:
    prefix = ros_prefix(tmp_path / "other", version)
    assert look(FOLDER, variables(tmp_path, "jazzy", AMENT_PREFIX_PATH=str(prefix)))["lock"] == FOLDER / LOCKS["jazzy"]


def test_a_distribution_that_is_not_supported_is_not_replaced_silently(tmp_path: Path) -> None:
    prefix = ros_prefix(tmp_path / "iron", "4.1.6")
    with pytest.raises(UsageError, match=r"is iron .*; set ros2: jazzy to use the wheels$"):
        look(FOLDER, variables(tmp_path, "true", AMENT_PREFIX_PATH=str(prefix)))


@pytest.mark.parametrize(("system", "arch"), [("Linux", "ARM64"), ("macOS", "ARM64"), ("Windows", "X64")])
def test_machines_without_wheels_are_refused(system: str, arch: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError) as caught:
        look(FOLDER, variables(tmp_path, "true", RUNNER_OS=system, RUNNER_ARCH=arch))
    assert str(caught.value) == (
        "ros2: true needs a runner with Linux x86-64, such as ubuntu-latest, or one with ROS 2 (jazzy or kilted), such "
        f"as the container ros:jazzy; this one is {system} {arch}"
    )


@pytest.mark.parametrize("wanted", ["", "yes", "humble"])
def test_other_values_are_one_line(
    wanted: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["ros2.py", "look"])
    monkeypatch.setattr("os.environ", variables(tmp_path, wanted))
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 2
    message = f"the input ros2 must be true, jazzy, kilted or false; found '{wanted}'"
    assert capsys.readouterr().err == f"::error title=sim-action::{message}\n"


def test_the_installation_is_checked_and_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    prefix = ros_prefix(tmp_path / "env", wheels=True)
    monkeypatch.setattr(environment, "install", lambda *_: {"python": prefix / "bin/python"})
    plan = json.dumps({"ready": "", "left_out": [], "kept": ""})
    outputs = install(FOLDER / LOCKS["jazzy"], variables(tmp_path, "jazzy", PLAN=plan))
    assert outputs == {"python": prefix / "bin/python"}
    assert capsys.readouterr().out.startswith(f"ROS 2: jazzy in {prefix}")
    (prefix / "share/rclpy/package.xml").unlink()
    with pytest.raises(UsageError, match="has no rclpy"):
        install(FOLDER / LOCKS["jazzy"], variables(tmp_path, "jazzy", PLAN=plan))


@pytest.mark.parametrize(("allowed", "event", "runs"), [("true", "", 2), ("false", "", 0), ("auto", "issues", 0)])
def test_messages_are_built_for_scenarios_that_import_them(
    allowed: str, event: str, runs: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / ".git").mkdir()
    interfaces(tmp_path, "my_msgs", "bool good\n")
    (tmp_path / "node.py").write_text("from my_msgs.msg import Speed\n")
    (tmp_path / "s.sim.yml").write_text("commands: {ros2: {nodes: [./node.py]}}\n")
    python = {"SETUP_PYTHON": "/setup/python", "SIM_ACTION_ROS2_PYTHON": "/env/bin/python", "GITHUB_EVENT_NAME": event}
    inputs = {"INPUT_SCENARIO": "*.sim.yml\n", "INPUT_WORKING_DIRECTORY": ".", "INPUT_PASS_ENV": "A\nB"}
    commands = list[list[str]]()

    def run(command: list[str], *, check: bool) -> subprocess.CompletedProcess[str]:
        commands.append([str(word) for word in command])
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr("action.ros2.subprocess.run", run)
    assert messages(FOLDER, {**python, **inputs, "INPUT_ALLOW_SCRIPTS": allowed, "GITHUB_ACTIONS": "true"}) == 0
    assert len(commands) == runs
    if runs:
        pip, prepare = commands
        assert pip[-3:] == ["/env", "--requirement", str(FOLDER / "requirements-ros2-messages.lock")]
        assert prepare[4:] == [
            *("ros2", "prepare", "--scenario=*.sim.yml", "--allow-scripts=true", "--pass-env=A", "--pass-env=B")
        ]
