from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import pytest

from action import environment, wheels
from action.environment import Plan, add, folder_problem, install, key, look
from action.lock import Entry, LockError, text_of
from action.wheels import InstallError
from tests.action.conftest import MakeWheel

ROOT = Path(__file__).parents[2]
RUNNER = {"RUNNER_OS": "Linux", "RUNNER_ARCH": "X64", "INPUT_CACHE": "true", "GITHUB_EVENT_NAME": "pull_request"}


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "home"
    monkeypatch.setenv("HOME", str(folder))
    monkeypatch.setenv("USERPROFILE", str(folder))
    return folder


@dataclass(frozen=True)
class Job:
    """A job on a runner, with the folders that it has."""

    temp: Path
    variables: dict[str, str]
    downloads: list[list[str]]
    home: Path


@pytest.fixture
def job(temp: Path, variables: dict[str, str], downloads: list[list[str]], home: Path) -> Job:
    return Job(temp, variables, downloads, home)


@pytest.fixture
def temp(tmp_path: Path) -> Path:
    folder = tmp_path / "temp"
    folder.mkdir()
    return folder


@pytest.fixture
def variables(tmp_path: Path) -> dict[str, str]:
    workspace = tmp_path / "work/robots/robots"
    workspace.mkdir(parents=True)
    return {**RUNNER, "GITHUB_WORKSPACE": str(workspace), "INPUT_WORKING_DIRECTORY": str(workspace)}


@pytest.fixture
def packages(make_wheel: MakeWheel) -> list[Entry]:
    return [
        make_wheel("click"),
        make_wheel("mujoco-core", files={"mujoco/__init__.py": "ORIGIN = 'wheel'\n", "mujoco.libs/a.so": ""}),
        make_wheel("pybullet", files={"pybullet.py": "ORIGIN = 'wheel'\n"}),
    ]


@pytest.fixture(autouse=True)
def downloads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The downloads, each with its packages; they come from the folder `wheels`."""
    done: list[list[str]] = []

    def download(packages: Sequence[Entry], folder: Path) -> None:
        done.append([entry.name for entry in packages])
        folder.mkdir(exist_ok=True)
        for entry in packages:
            for wheel in (tmp_path / "wheels").glob(f"{entry.name.replace('-', '_')}-*"):
                shutil.copy(wheel, folder)

    monkeypatch.setattr(wheels, "download", download)
    return done


def planned(packages: Sequence[Entry], temp: Path, variables: dict[str, str]) -> Plan:
    return Plan.parse(str(look(packages, temp, variables)["plan"]))


def made(packages: Sequence[Entry], temp: Path, variables: dict[str, str]) -> Path:
    """The environment after both steps."""
    python = Path(str(install(packages, planned(packages, temp, variables), temp)["python"]))
    return python.parent.parent


def test_the_plan_survives_as_one_line() -> None:
    plan = Plan("/a folder/ü\n", ("mujoco",), "~/kept", "~/extras")
    assert "\n" not in plan.text()
    assert Plan.parse(plan.text()) == plan


def test_a_scenario_without_an_engine_needs_the_default_one_alone(packages: list[Entry], job: Job) -> None:
    folder = made(packages, job.temp, job.variables)
    assert job.downloads == [["click", "pybullet"]]
    assert (folder / "requirements.lock").read_text() == text_of([packages[0], packages[2]])


def test_nothing_is_searched_without_engines(packages: list[Entry], job: Job, monkeypatch: pytest.MonkeyPatch) -> None:
    searched: list[object] = []
    monkeypatch.setattr("action.environment.asked_engines", searched.append)
    look(packages[:1], job.temp, job.variables)
    assert searched == []


@pytest.mark.parametrize(
    ("backend", "present"),
    [("mujoco", ["mujoco-core"]), ("all", ["mujoco-core", "pybullet"]), ("pybullet", ["pybullet"])],
)
def test_the_engine_of_the_input_counts(backend: str, present: list[str], packages: list[Entry], job: Job) -> None:
    made(packages, job.temp, {**job.variables, "INPUT_BACKEND": backend})
    assert job.downloads == [["click", *present]]


def test_systems_with_one_engine_get_it(packages: list[Entry], job: Job) -> None:
    made(packages[:2], job.temp, {**job.variables, "INPUT_BACKEND": "pybullet"})
    assert job.downloads == [["click", "mujoco-core"]]


def test_the_key_depends_on_content(packages: list[Entry], variables: dict[str, str], make_wheel: MakeWheel) -> None:
    found = key(packages, variables)
    assert found.startswith(f"sim-action-Linux-X64-{sys.implementation.cache_tag}-pybullet-mujoco-")
    assert "no-engine" in key(packages[:1], variables)
    newer = make_wheel("click", "1.1")
    keys = [found, key([newer, *packages[1:]], variables), key(packages, {**variables, "RUNNER_ARCH": "ARM64"})]
    assert len({*keys, key(packages[1:], variables)}) == 4
    assert all(len(each) < 200 and "," not in each for each in keys)


def test_no_path_is_in_caches(packages: list[Entry], job: Job, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two runners with other folders share a cache, if the home folder has the same place seen from the workspace."""
    job.variables["GITHUB_WORKSPACE"] = str(tmp_path / "home/work/robots/robots")
    here = look(packages, job.temp, job.variables)
    monkeypatch.setenv("HOME", str(tmp_path / "elsewhere/someone"))
    job.variables["GITHUB_WORKSPACE"] = str(tmp_path / "elsewhere/someone/work/other/other")
    there = look(packages, job.temp, job.variables)
    assert [here[name] for name in ("wheels", "key", "plan")] == [there[name] for name in ("wheels", "key", "plan")]
    assert str(here["wheels"]).startswith("~/")
    job.variables["GITHUB_WORKSPACE"] = str(tmp_path / "volume/robots")
    assert look(packages, job.temp, job.variables)["key"] != here["key"], "restored files would land elsewhere"


@pytest.mark.parametrize(
    ("wanted", "event", "cached"),
    [
        ("true", "push", True),
        ("true", "pull_request", True),
        ("false", "push", False),
        ("true", "pull_request_target", False),
        ("true", "workflow_run", False),
        ("true", "issue_comment", False),
    ],
)
def test_when_wheels_are_kept(wanted: str, event: str, cached: bool, packages: list[Entry], job: Job) -> None:
    found = look(packages, job.temp, {**job.variables, "INPUT_CACHE": wanted, "GITHUB_EVENT_NAME": event})
    assert found["cache"] is cached
    done = install(packages, Plan.parse(str(found["plan"])), job.temp)
    assert done["fetched"] is cached
    assert job.home.exists() is cached
    with pytest.raises(LockError, match="cache must be true or false"):
        look(packages, job.temp, {**job.variables, "INPUT_CACHE": "maybe"})


@pytest.mark.parametrize(
    ("name", "shown"), [("robto", "'robto'"), ("a\n::error::b", "'a\\n::error::b'"), ("##[x]%0A", "'# #[x]%250A'")]
)
def test_a_missing_working_directory_is_named_before_anything_is_downloaded(name: str, shown: str) -> None:
    assert folder_problem(name) == (
        f"the input working-directory: there is no folder {shown}; name one that is checked out, from its top"
    )
    assert folder_problem(" . ") is folder_problem("") is None


def test_kept_wheels_are_used_again_without_a_cache_service(packages: list[Entry], job: Job, tmp_path: Path) -> None:
    made(packages, job.temp, job.variables)
    other = tmp_path / "other temp"
    other.mkdir()
    found = look(packages, other, job.variables)
    assert not found["cache"]
    assert install(packages, Plan.parse(str(found["plan"])), other)["fetched"] is False
    assert len(job.downloads) == 1


def test_extras_have_their_own_cache(packages: list[Entry], job: Job, make_wheel: MakeWheel, tmp_path: Path) -> None:
    """Jobs with the folders of others, and what each downloads and saves; all but the last ones need both engines."""
    more, both = [make_wheel("lz4")], {**job.variables, "INPUT_BACKEND": "all"}
    keys = set()
    for number, (variables, extras, downloaded) in enumerate(
        [(both, [], [3]), (both, more, [1]), (both, more, []), (job.variables, more, [2]), (job.variables, [], [])]
    ):
        temp = tmp_path / f"temp {number}"
        temp.mkdir()
        job.downloads.clear()
        found = look(packages, temp, variables, extras)
        assert found["cache-extras"] is (number == 1)
        done = install(packages, Plan.parse(str(found["plan"])), temp, extras)
        assert [len(names) for names in job.downloads] == downloaded
        assert (done["fetched"], done["fetched-extras"]) == (number in (0, 3), number == 1)
        assert bool(list(temp.glob("*/lib/python*/site-packages/lz4"))) is bool(extras)
        keys |= {found["key"], found["key-extras"]} if extras else {found["key"]}
        again = look(packages, temp, variables)
        assert Plan.parse(str(again["plan"])).ready == str(Path(str(done["python"])).parents[1])
    assert len(keys) == 3


def kept_wheels(home: Path) -> Iterator[Path]:
    return home.glob(".cache/sim-action-wheels/*/*.whl")


@pytest.mark.parametrize("damage", ["poison", "missing", "second", "folder"])
def test_damaged_wheels_are_downloaded_again(damage: str, packages: list[Entry], job: Job, tmp_path: Path) -> None:
    made(packages, job.temp, job.variables)
    wheel = next(wheel for wheel in kept_wheels(job.home) if wheel.name.startswith("click"))
    if damage == "poison":
        wheel.write_bytes(b"poison")
    elif damage == "missing":
        wheel.unlink()
    elif damage == "folder":
        wheel.unlink()
        wheel.mkdir()
    else:
        shutil.copy(wheel, wheel.with_name("click-1.0-py2-none-any.whl"))
    other = tmp_path / "other temp"
    other.mkdir()
    done = install(packages, planned(packages, other, job.variables), other)
    assert done["fetched"]
    assert len(job.downloads) == 2
    assert sorted(wheel.name[:5] for wheel in kept_wheels(job.home)) == ["click", "pybul"]


def test_wheels_unused_for_a_month_are_removed(packages: list[Entry], temp: Path, job: Job, tmp_path: Path) -> None:
    both = {**job.variables, "INPUT_BACKEND": "all"}
    made(packages, temp, job.variables)
    made(packages, temp, both)
    folders = {Path(planned(packages, tmp_path, each).kept).expanduser() for each in (job.variables, both)}
    last_month = time.time() - 31 * 86_400
    for folder in folders:
        os.utime(folder, (last_month, last_month))
    other = tmp_path / "other temp"
    other.mkdir()
    made(packages, other, both)
    [left] = (job.home / ".cache/sim-action-wheels").iterdir()
    assert left == Path(planned(packages, tmp_path, both).kept).expanduser()
    assert left.stat().st_mtime > last_month + 86_400
    assert len(job.downloads) == 2


def test_wheels_not_kept_fail_nothing(packages: list[Entry], job: Job, capsys: pytest.CaptureFixture[str]) -> None:
    job.home.write_text("a file")
    assert install(packages, planned(packages, job.temp, job.variables), job.temp)["fetched"] is False
    assert "not cached" in capsys.readouterr().out


def test_without_a_home_nothing_is_cached(packages: list[Entry], job: Job, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.path.expanduser", lambda path: path)
    found = look(packages, job.temp, job.variables)
    assert (found["cache"], found["wheels"]) == (False, "")


def test_a_second_use_in_a_job_finds_the_environment(packages: list[Entry], job: Job) -> None:
    first = made(packages, job.temp, job.variables)
    found = look(packages, job.temp, job.variables)
    assert found["cache"] is False
    assert made(packages, job.temp, job.variables) == first
    assert len(job.downloads) == 1


def test_an_environment_with_more_packages_does_and_the_smallest_is_taken(packages: list[Entry], job: Job) -> None:
    whole = made(packages, job.temp, {**job.variables, "INPUT_BACKEND": "all"})
    assert made(packages[:1], job.temp, job.variables) == whole
    (whole / "requirements.lock").rename(whole / "hidden")
    small = made(packages[:1], job.temp, job.variables)
    (whole / "hidden").rename(whole / "requirements.lock")
    assert made(packages[:1], job.temp, job.variables) == small
    assert made(packages, job.temp, {**job.variables, "INPUT_BACKEND": "all"}) == whole
    assert len(job.downloads) == 2


def test_environments_of_other_versions_stay_apart(packages: list[Entry], job: Job, make_wheel: MakeWheel) -> None:
    first = made(packages[:1], job.temp, job.variables)
    newer = make_wheel("click", "1.1")
    (job.temp.parent / "wheels/click-1.0-py3-none-any.whl").unlink()
    assert made([newer], job.temp, job.variables) != first


def test_an_environment_that_appears_after_the_plan_is_not_used(packages: list[Entry], job: Job) -> None:
    """It can come from a cache."""
    plan = planned(packages, job.temp, job.variables)
    planted = made(packages, job.temp, job.variables)
    done = install(packages, plan, job.temp)
    assert Path(str(done["python"])).parent.parent != planted


def test_a_killed_installation_is_incomplete(packages: list[Entry], job: Job, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patched:
        patched.setattr(environment, "_complete", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            made(packages, job.temp, job.variables)
    [left] = job.temp.glob("sim-action-*")
    assert not planned(packages, job.temp, job.variables).ready
    assert made(packages, job.temp, job.variables) != left


def test_a_failed_installation_leaves_nothing(packages: list[Entry], job: Job, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise InstallError

    monkeypatch.setattr(wheels, "download", fail)
    with pytest.raises(InstallError):
        made(packages, job.temp, job.variables)
    assert not list(job.temp.iterdir())


def test_broken_markers_and_missing_interpreters_are_passed_over(packages: list[Entry], job: Job) -> None:
    for number, content in enumerate([b"\xff", b"no package", b""]):
        folder = job.temp / f"sim-action-{number}"
        folder.mkdir()
        (folder / "requirements.lock").write_bytes(content)
    assert not planned(packages, job.temp, job.variables).ready
    environment._python(made(packages, job.temp, job.variables)).unlink()
    assert not planned(packages, job.temp, job.variables).ready


def test_two_installations_at_the_same_time_do_not_share_a_folder(packages: list[Entry], job: Job) -> None:
    plan = planned(packages, job.temp, job.variables)
    folders = {install(packages, plan, job.temp)["python"] for _ in range(2)}
    assert len(folders) == 2


def test_jobs_that_share_all_folders_do_not_disturb_each_other(packages: list[Entry], job: Job) -> None:
    plan = planned(packages, job.temp, job.variables)
    with ThreadPoolExecutor(4) as pool:
        pythons = [
            Path(str(done["python"])) for done in pool.map(lambda _: install(packages, plan, job.temp), range(8))
        ]
    assert len(set(pythons)) == 8
    assert all(list(python.parent.parent.rglob("click/__init__.py")) for python in pythons)
    assert all((python.parent.parent / "requirements.lock").is_file() for python in pythons)
    assert sorted(path.name[:5] for path in next(job.home.glob(".cache/sim-action-wheels/*")).iterdir()) == [
        "click",
        "pybul",
    ]


def test_folders_of_windows_are_its_own(packages: list[Entry], temp: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    get_paths = sysconfig.get_paths
    monkeypatch.setattr("sysconfig.get_paths", lambda _, variables: get_paths("nt_venv", variables))
    monkeypatch.setattr("sys.platform", "win32")
    folders = environment._folders(temp)
    assert folders["purelib"] == folders["platlib"] == temp / "Lib/site-packages"
    assert folders["scripts"] / "python.exe" == environment._python(temp)


PROGRAM = """
import importlib.metadata, importlib.util, sys
assert importlib.util.find_spec("mujoco") is not None
assert importlib.metadata.version("mujoco-core") == "1.0"
import mujoco
assert sys.modules["mujoco"] is mujoco
import mujoco as again
assert again is mujoco
print(mujoco.ORIGIN)
"""


def run_python(folder: Path, program: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([folder / "bin/python", "-c", program], capture_output=True, text=True, check=False)


@pytest.fixture
def by_default(packages: list[Entry], job: Job, tmp_path: Path) -> Path:
    """An environment without MuJoCo, whose placeholder installs it from the folder `wheels`."""
    folder = made(packages, job.temp, job.variables)
    [module] = folder.rglob("mujoco.py")
    program = f"""
import shutil, sys
sys.path.insert(0, {str(ROOT)!r})
from pathlib import Path
from action import environment, wheels
def download(packages, folder):
    shutil.copytree({str(tmp_path / "wheels")!r}, folder)
wheels.download = download
folder = Path({str(folder)!r})
environment.add(folder, folder / "left-out.lock", "mujoco")
"""
    text = module.read_text()
    command = json.dumps([sys.executable, "-I", "-c", program])
    before, _, after = text.partition("subprocess.run([")
    module.write_text(f"{before}subprocess.run({command}{after[after.index('], stdout') + 1 :]}")
    return folder


@pytest.mark.process
def test_an_engine_that_was_left_out_is_installed_on_import(job: Job, by_default: Path, packages: list[Entry]) -> None:
    first = run_python(by_default, PROGRAM)
    assert (first.stdout, first.returncode) == ("wheel\n", 0), first.stderr
    assert "mujoco is installed now" in first.stderr
    second = run_python(by_default, PROGRAM)
    assert (second.stdout, second.stderr) == ("wheel\n", "")
    whole = {**job.variables, "INPUT_BACKEND": "all"}
    assert planned(packages, job.temp, whole).ready == str(by_default)


@pytest.mark.process
def test_processes_can_install_an_engine_at_the_same_time(by_default: Path) -> None:
    command = [str(by_default / "bin/python"), "-c", PROGRAM]
    both = [subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) for _ in range(3)]
    for process in both:
        printed, errors = process.communicate()
        assert printed == "wheel\n", errors


@pytest.mark.process
def test_an_engine_that_cannot_be_installed_is_an_import_error(by_default: Path, tmp_path: Path) -> None:
    shutil.rmtree(tmp_path / "wheels")
    ran = run_python(by_default, "import mujoco")
    assert ran.returncode == 1
    assert "ImportError: mujoco could not be installed: " in ran.stderr
    assert "No such file" in ran.stderr


def test_the_placeholder_runs_this_script_and_interpreter(packages: list[Entry], job: Job) -> None:
    folder = made(packages, job.temp, job.variables)
    [module] = folder.rglob("mujoco.py")
    script = str(ROOT / "action/environment.py")
    assert repr([sys.executable, "-I", script, "add", str(folder), "mujoco"]) in module.read_text()
    assert not list(folder.rglob("pybullet-*/PLACEHOLDER"))
    # The engine is added from the lock file of those left out.
    add(folder, folder / "left-out.lock", "mujoco")
    assert job.downloads[1:] == [["mujoco-core"]]
    assert not list(folder.glob("adding-*"))
    [found] = folder.rglob("mujoco/__init__.py")
    assert found.read_text() == "ORIGIN = 'wheel'\n"
