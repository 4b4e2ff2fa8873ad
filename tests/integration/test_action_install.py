"""What the action installs, where from, and what it keeps between runs."""

from __future__ import annotations

import csv
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from action.lock import entries_here, normalized, without_engines
from tests.integration.conftest import ACTION, TUTORIAL, environment, write
from tests.integration.github import CacheStore, Runner, base_python
from tests.soak import soaked

CUBE = """<mujoco><worldbody>
<body name="cube"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="1"/></body></worldbody>
</mujoco>"""
NATIVE = "name: cube\nrobot: {model: cube.xml}\nexpect: [upright]\nduration: 2 s\ntime_limit: 2 s\n"


def test_second_use_in_a_job_installs_nothing_and_the_time_of_set_up_is_told(runner: Runner) -> None:
    configuration = environment(runner.temp) / "pyvenv.cfg"
    made = configuration.stat().st_mtime_ns
    result = runner.run(ACTION)
    assert configuration.stat().st_mtime_ns == made
    assert re.search(r"^Set-up took \d+ s: Python \d+ s, install \d+ s, other steps \d+ s$", result.log, re.MULTILINE)


def installed_bytes(site: Path) -> dict[str, tuple[int, int]]:
    """Package -> size of its files as installed by the action, and as by pip, which does not leave out any."""
    sizes = {}
    for record in site.glob("*.dist-info/RECORD"):
        with record.open(encoding="utf-8", newline="") as file:
            rows = [(row[0], int(row[2] or 0)) for row in csv.reader(file)]
        here = sum((site / name).stat().st_size for name, _ in rows if (site / name).is_file())
        sizes[normalized(record.parent.name.partition("-")[0])] = here, sum(size for _, size in rows)
    return sizes


def test_the_page_of_costs_states_what_is_downloaded_and_installed(runner_temp: Path) -> None:
    """In MB of 10^6 bytes, to the next one; `make lock` may change them."""
    folder = environment(runner_temp)
    sizes = installed_bytes(folder / "lib/python3.11/site-packages")
    wheels = runner_temp / "home/.cache/sim-action-wheels"
    downloads = {normalized(wheel.name.partition("-")[0]): wheel.stat().st_size for wheel in wheels.glob("*/*.whl")}

    def packages(lock: str, *left_out: str) -> list[str]:
        return [entry.name for entry in without_engines(entries_here([ACTION / "action/locks" / lock]), left_out)]

    chosen = {
        "no scenario names an engine, on Linux x86-64": packages("requirements.lock", "mujoco"),
        "`backend: mujoco` for all scenarios, and systems without PyBullet": packages("requirements.lock", "pybullet"),
        "both engines": packages("requirements.lock"),
        "`merge`": packages("requirements-reports.lock"),
        "`matrix` and `compare`": packages("requirements-core.lock"),
    }

    def row(case: str, names: list[str], way: int) -> str:
        size, installed = sum(downloads[n] for n in names) / 1e6, sum(sizes[n][way] for n in names) / 1e6
        return f"| {case} | {size:.0f} MB | {installed:.0f} MB |"

    rows = [row(case, names, 0) for case, names in chosen.items()]
    rows.append(
        row("`pip install sim-action` on Linux x86-64 with Python 3.11", packages("requirements.lock", "mujoco"), 1)
    )
    page = (ACTION / "docs/workflow/costs.md").read_text(encoding="utf-8")
    assert [line for line in page.splitlines() if line in rows] == rows


def test_package_with_another_hash_is_refused(tmp_path: Path) -> None:
    action = action_with_lock(tmp_path / "action", f"click==8.1.8 --hash=sha256:{'0' * 64}\n")
    result = Runner(tmp_path, tmp_path).run(action)
    assert result.exit_code != 0
    assert result.steps[-1] == "Install dependencies"
    assert "DO NOT MATCH THE HASHES" in result.log
    assert "could not be installed" in result.annotations[0].message
    assert not list(tmp_path.glob("sim-action-*/requirements.lock"))


def entries_of(lock: str, packages: str) -> str:
    text = (ACTION / "action/locks" / lock).read_text(encoding="utf-8")
    return "".join(re.findall(rf"^(?:{packages})==.*(?:\n +--hash.*)+\n", text, re.MULTILINE))


SMALL_LOCK = entries_of("requirements.lock", "annotated-types")  # one small wheel without dependencies


def action_with_lock(folder: Path, lock: str = SMALL_LOCK) -> Path:
    for name in ("action", "matrix", "compare", "merge"):
        shutil.copytree(ACTION / name, folder / name)
    shutil.copy(ACTION / "action.yml", folder)
    write(folder / "action/locks/requirements.lock", lock)
    return folder


def test_extras_that_are_not_known_are_told_before_anything_is_installed(tmp_path: Path) -> None:
    result = Runner(tmp_path, tmp_path).run(ACTION, {"extras": "numpy==1.0"})
    assert result.exit_code != 0
    assert result.steps[-1] == "Look for the environment"
    assert "extras must be empty, or some of mcap, policy, rosbags, video" in result.annotations[0].message


def new_machine(folder: Path, cache: CacheStore, event: str = "push", **variables: str) -> Runner:
    """A runner with the folders of all runners, in a place of its own."""
    workspace, temp = folder / "work/robots/robots", folder / "work/_temp"
    for made in (workspace, temp):
        made.mkdir(parents=True)
    return Runner(workspace, temp, event_name=event, cache=cache, variables={"HOME": str(folder), **variables})


def test_wheels_are_kept_between_runs_and_checked_like_all_others(tmp_path: Path) -> None:
    action = action_with_lock(tmp_path / "action")
    cache = CacheStore(tmp_path / "cache")

    def steps_on(machine: str, event: str = "push") -> tuple[str, ...]:
        runner = new_machine(tmp_path / machine, cache, event)
        result = runner.run(action)
        assert list(runner.temp.glob("sim-action-*/lib/python3.11/site-packages/annotated_types")), result.log
        return result.steps

    assert "Restore wheels" not in steps_on("privileged", "pull_request_target")
    assert "Save wheels" in steps_on("first")
    assert "Save wheels" not in steps_on("second")
    [wheel] = (tmp_path / "cache").rglob("*.whl")
    wheel.write_bytes(b"poison")
    assert "Save wheels" in steps_on("third")


def test_extras_are_installed_on_top_of_the_wheels_that_jobs_without_them_have_cached(tmp_path: Path) -> None:
    action = action_with_lock(tmp_path / "action")
    lock = "requirements-rosbags.lock"
    write(action / "action/locks" / lock, SMALL_LOCK + entries_of(lock, "rosbags|apsw|lz4|ruamel-yaml"))
    cache, saved = CacheStore(tmp_path / "cache"), []
    for machine, extras in (("first", ""), ("second", "rosbags"), ("third", "rosbags")):
        runner = new_machine(tmp_path / machine, cache)
        result = runner.run(action, {"extras": extras})
        assert "Run scenarios" in result.steps
        [installed] = runner.temp.glob("sim-action-*/lib/python3.11/site-packages")
        expected = {"annotated_types"} | ({"rosbags", "apsw", "lz4", "ruamel"} if extras else set())
        assert expected <= {path.name for path in installed.iterdir()}, result.log
        saved.append([step for step in result.steps if step.startswith("Save")])
    assert saved == [["Save wheels"], ["Save wheels of extras"], []]


def test_the_engine_that_scenarios_ask_for_is_installed_and_others_when_they_are_imported(
    tmp_path: Path, runner_temp: Path
) -> None:
    """A scenario outside the working directory asks for an engine that was not seen."""
    wheels = tmp_path / "index"  # pip divides the variable at spaces
    wheels.symlink_to(next((runner_temp / "home/.cache/sim-action-wheels").glob("*/mujoco_core-*.whl")).parent)
    settings = {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(wheels)}
    runner = new_machine(tmp_path / "machine", CacheStore(tmp_path / "cache"), **settings)
    write(runner.workspace / "inside/a.sim.yml", TUTORIAL)
    write(runner.workspace / "outside/named.sim.yml", f"{TUTORIAL}\nbackend: mujoco\n")
    write(runner.workspace / "outside/compared.sim.yml", f"{TUTORIAL}\nagreement: {{position: 10 cm}}\n")
    write(runner.workspace / "outside/native.sim.yml", NATIVE)
    write(runner.workspace / "outside/cube.xml", CUBE)
    inputs = {"working-directory": "inside", "scenario": "a.sim.yml\n../outside", "report": "false"}
    result = runner.run(ACTION, inputs)
    assert "wheels in" in result.log
    assert "(pybullet)." in result.log
    assert list(runner.temp.rglob("site-packages/mujoco/__init__.py"))
    assert (result.exit_code, result.outputs["passed"]) == (0, "5"), result.log


@pytest.mark.parametrize(("system", "arch"), [("macOS", "X64"), ("Linux", "ARM")])
def test_other_machines_are_refused_before_anything_is_installed(tmp_path: Path, system: str, arch: str) -> None:
    result = Runner(tmp_path, tmp_path, os=system, arch=arch).run(ACTION)
    assert (result.exit_code, result.steps) == (2, ("Check the runner",))
    [annotation] = result.annotations
    assert f"{system} {arch}" in annotation.message
    assert "macos-latest" in annotation.message


@pytest.mark.parametrize(
    ("system", "arch"), soaked([("Linux", "ARM64"), ("macOS", "ARM64"), ("Windows", "X64")], short=[("Windows", "X64")])
)
def test_machines_for_which_an_engine_has_wheels_are_let_in(
    tmp_path: Path, runner_temp: Path, system: str, arch: str
) -> None:
    result = Runner(tmp_path, runner_temp, os=system, arch=arch).run(ACTION)
    assert result.steps[-1] == "Run scenarios"


def test_base_python_is_what_the_action_asks_for() -> None:
    version = subprocess.run([base_python(), "--version"], capture_output=True, text=True, check=True).stdout
    assert version.startswith("Python 3.11.")


@pytest.mark.parametrize(
    "settings",
    [
        {"PIP_TARGET": "elsewhere"},
        pytest.param({"PIP_PREFIX": "elsewhere", "PIP_USER": "1"}, marks=pytest.mark.soak),
        pytest.param({"PIP_ROOT": "elsewhere", "PIP_DRY_RUN": "1"}, marks=pytest.mark.soak),
        {"PIP_REQUIRE_VIRTUALENV": "true", "PIP_PYTHON": "/nowhere"},
    ],
    ids="+".join,
)
def test_settings_of_pip_that_a_job_has_lead_no_package_elsewhere(settings: dict[str, str], tmp_path: Path) -> None:
    action = action_with_lock(tmp_path / "action")
    result = Runner(tmp_path, tmp_path, variables=settings).run(action, {"cache": "false"})
    assert list(tmp_path.glob("sim-action-*/lib/python3.11/site-packages/annotated_types")), result.log
    assert not (tmp_path / "elsewhere").exists()


@pytest.mark.soak
@pytest.mark.parametrize("distribution", ["jazzy", "kilted"])
def test_ros_2_is_installed_and_kept_between_runs(distribution: str, tmp_path: Path, runner_temp: Path) -> None:
    cache = CacheStore(tmp_path / "cache")
    for name, is_saved in (("first", True), ("second", False)):
        runner = new_machine(tmp_path / name, cache)
        write(runner.workspace / "a.sim.yml", TUTORIAL)
        result = runner.run(ACTION, {"ros2": distribution, "report": "false"})
        assert result.exit_code == 0, result.log
        assert ("Save wheels of ROS 2" in result.steps) == is_saved
        [python] = re.findall(r"^ROS 2: .* for (.*)$", result.log, re.MULTILINE)
        imported = [python, "-c", "import rclpy; print(rclpy.get_rmw_implementation_identifier())"]
        assert subprocess.check_output(imported, text=True).strip() == "rmw_fastrtps_cpp"
