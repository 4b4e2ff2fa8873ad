"""Keys of runs: each input that an outcome may depend on changes them, and no other one does."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from sim_action.core.permissions import Permissions
from sim_action.runner import run_keys as module
from sim_action.runner.child_outcome import engine_provenance
from sim_action.runner.run_keys import RunKeys, RunOptions
from sim_action.runner.run_plan import engine_runs
from sim_action.scenario.files import read_file
from sim_action.scenario.loading import checked
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.source import Source

pytestmark = pytest.mark.process

NATIVE = """\
name: burger drives
robot: {model: turtlebot3_burger}
world: {objects: [{name: rock, mesh: {file: rock.obj}, pose: {x: 3}}]}
commands: {rate: 10 Hz, twist: [{linear: 1.0}]}
expect: [{travel: {at_least: 1.5 m}}]
time_limit: 30 s
"""
ROCK = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
SCRIPTED = """\
name: burger is driven
robot: {model: turtlebot3_burger}
commands: {rate: 10 Hz, script: drive.py}
expect: [{travel: {at_least: 1.5 m}}]
time_limit: 30 s
"""
DRIVE = "from sim_action import Twist\n\n\ndef control(observation):\n    return Twist(linear=1.0)\n"
OPTIONS = RunOptions(Permissions())


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The root of a repository; its files were written long ago."""
    now = time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: now() + 3_600_000_000_000)
    monkeypatch.chdir(tmp_path)
    files = {"native.sim.yml": NATIVE, "rock.obj": ROCK, "scripted.sim.yml": SCRIPTED, "drive.py": DRIVE, "notes": ""}
    for name, text in {**files, ".gitignore": "rock.obj\nignored\n"}.items():
        Path(name).write_text(text, encoding="utf-8")
    git("init", "-q")
    git("add", ".")
    return tmp_path


def git(*words: str) -> None:
    subprocess.run(["git", *words], check=True, capture_output=True)


def plan(name: str, options: RunOptions = OPTIONS, engine: str | None = None) -> LoadedScenario:
    (source,) = read_file(Path(name), options.permissions)
    assert isinstance(source, Source), source
    (run,) = engine_runs(checked(source, options.permissions), engine)
    return run


def key(run: LoadedScenario | None = None, options: RunOptions = OPTIONS, output: str = "sim-results") -> str | None:
    """The key of a run in a call of its own."""
    loaded = run or plan("scripted.sim.yml", options)
    keys = RunKeys([loaded.source.path], options, [Path(output)])
    try:
        return keys.of(loaded)
    finally:
        keys.close()


def native() -> str | None:
    return key(plan("native.sim.yml"))


def scripted() -> str | None:
    return key(plan("scripted.sim.yml"))


KINDS = pytest.mark.parametrize("kind", [native, scripted])
Kind = Callable[[], str | None]


def edited(name: str, text: str = "# another\n") -> None:
    with Path(name).open("a", encoding="utf-8") as file:
        file.write(text)


@KINDS
def test_keys_of_equal_calls_are_equal(kind: Kind) -> None:
    first = kind()
    assert first is not None
    assert len(first) == 64
    assert kind() == first


def test_scenarios_have_keys_of_their_own() -> None:
    assert native() != scripted()


@KINDS
@pytest.mark.parametrize("name", ["native.sim.yml", "scripted.sim.yml", "drive.py", "notes"])
def test_every_file_that_git_sees_counts(kind: Kind, name: str) -> None:
    before = kind()
    edited(name)
    assert kind() != before


def test_an_ignored_file_counts_if_the_scenario_names_it() -> None:
    before, other = native(), scripted()
    edited("rock.obj")
    assert native() != before
    assert scripted() == other
    edited("ignored")
    assert scripted() == other


@KINDS
def test_outputs_do_not_count(kind: Kind) -> None:
    before = kind()
    Path("sim-results").mkdir()
    edited("sim-results/results.json")
    assert kind() == before


@pytest.mark.parametrize("output", ["a\0b", "loop/results", "x" * 5000])
def test_any_output_folder_is_allowed(output: str) -> None:
    Path("loop").symlink_to("loop")
    assert key(output=output) is not None


@KINDS
@pytest.mark.parametrize("name", ["GITHUB_SHA", "RUNNER_TEMP", "PWD", "COLUMNS", "TMPDIR", "SIM_ACTION_RESUME", "_"])
def test_volatile_variables_do_not_count(kind: Kind, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    before = kind()
    monkeypatch.setenv(name, "another")
    assert kind() == before


def test_other_variables_count_for_user_code(monkeypatch: pytest.MonkeyPatch) -> None:
    before, other = scripted(), native()
    monkeypatch.setenv("ROS_DISTRO", "fast")
    assert scripted() != before
    assert native() == other


def test_passed_variables_count_for_user_code(monkeypatch: pytest.MonkeyPatch) -> None:
    passing = RunOptions(Permissions(pass_env=("MY_ROBOT",)))
    before, other = key(options=passing), key(plan("native.sim.yml"), passing)
    monkeypatch.setenv("MY_ROBOT", "fast")
    assert key(options=passing) not in (None, before)
    assert key(plan("native.sim.yml"), passing) == other


def test_variables_of_the_scenario_count() -> None:
    before = scripted()
    edited("scripted.sim.yml", "environment: {MY_ROBOT: fast}\n")
    assert scripted() not in (None, before)


@KINDS
def test_variables_of_native_code_count(kind: Kind, monkeypatch: pytest.MonkeyPatch) -> None:
    before = kind()
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    assert kind() != before


def test_secrets_do_not_count_because_code_does_not_see_them(monkeypatch: pytest.MonkeyPatch) -> None:
    before = scripted()
    for name in ("GH_TOKEN", "ROS_TOKEN", "MY_ROBOT", "DATABASE_URL"):
        monkeypatch.setenv(name, "secret")
    assert scripted() == before


@pytest.mark.parametrize(
    "options",
    [
        RunOptions(Permissions(outside=True)),
        RunOptions(Permissions(scripts_refused="no")),
        RunOptions(Permissions(), repeat=2),
        RunOptions(Permissions(), formats=("csv",)),
        RunOptions(Permissions(), replays=False),
    ],
    ids=["outside", "scripts", "repeat", "formats", "replays"],
)
def test_options_count(options: RunOptions) -> None:
    run = plan("native.sim.yml")
    assert key(run, options) not in (None, key(run))


def test_the_order_of_formats_does_not_count() -> None:
    one, other = (RunOptions(Permissions(), formats=formats) for formats in (("csv", "tum"), ("tum", "csv")))
    assert key(options=one) == key(options=other)


@pytest.mark.parametrize(
    "changes",
    [{"seed": 1}, {"unexercised": "warn"}, {"name": "another"}, {"backend": "mujoco"}],
    ids=["seed", "unexercised", "name", "engine"],
)
def test_values_of_the_command_line_count(changes: dict[str, object]) -> None:
    run = plan("native.sim.yml", engine="pybullet")
    other = replace(run, scenario=run.scenario.model_copy(update=changes))
    assert key(other) not in (None, key(run))


def test_the_rate_of_the_trace_counts() -> None:
    run = plan("native.sim.yml")
    assert key(run.traced_at_every_step()) != key(run)


def test_variations_have_keys_of_their_own() -> None:
    Path("native.sim.yml").write_text(NATIVE + "variations: {seed: [1, 2], world.ground.friction: [0.5, 1]}\n")
    sources = read_file(Path("native.sim.yml"), Permissions())
    runs = [checked(source, Permissions()) for source in sources if isinstance(source, Source)]
    keys = RunKeys([Path("native.sim.yml")], OPTIONS, [])
    assert len({keys.of(run) for run in runs} - {None}) == 4


@pytest.mark.parametrize("part", ["source_digest", "_packages", "cpu_model"])
def test_software_and_machine_count(part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    before = key()
    monkeypatch.setattr(module, part, lambda *_: "another")
    assert key() != before


def test_the_place_of_a_virtual_environment_does_not_count(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, place = native(), tmp_path_factory.mktemp("environment") / "python"
    place.symlink_to(sys.executable)
    monkeypatch.setattr(sys, "executable", str(place))
    assert native() == before
    monkeypatch.setattr(sys, "executable", str(place.with_name("another")))
    assert native() != before


def test_the_build_of_the_engine_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    before = key()
    found = engine_provenance("auto")
    monkeypatch.setattr(module, "engine_provenance", lambda _: found.model_copy(update={"engine_build": "another"}))
    assert key() != before


def test_an_installed_package_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    site = tmp_path.parent / f"{tmp_path.name}-site"
    site.mkdir()
    monkeypatch.setattr(sys, "path", [*sys.path, str(site)])
    before = key()
    (site / "policy-1.0.dist-info").mkdir()
    one = key()
    (site / "policy-1.0.dist-info/RECORD").write_text("policy.py,sha256=1,1\n")
    assert len({before, one, key(), None}) == 4


def test_own_source_counts(tmp_path: Path) -> None:
    digest = module.source_digest
    found = set()
    for name, text in (("a.py", "1"), ("a.py", "2"), ("b.py", ""), ("c/d.urdf", "")):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
        found.add(digest(tmp_path))
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__/a.pyc").write_text("")
    found.add(digest(tmp_path))
    assert len(found) == 4


def test_without_git_only_code_has_no_key(monkeypatch: pytest.MonkeyPatch) -> None:
    with_git = native()
    monkeypatch.setenv("PATH", os.devnull)
    before = native()
    assert before not in (None, with_git)
    assert scripted() is None
    edited("notes")
    assert native() == before
    edited("rock.obj")
    assert native() != before


def test_nothing_has_a_key_while_golden_files_are_written() -> None:
    options = RunOptions(Permissions(updates_golden=True))
    assert key(plan("native.sim.yml", options), options) is None


def test_too_many_files_leave_no_key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_FILES", 2)
    assert native() is None


def test_a_file_that_changes_during_the_call_leaves_no_key(monkeypatch: pytest.MonkeyPatch) -> None:
    written_ns = Path("rock.obj").stat().st_ctime_ns
    monkeypatch.setattr(time, "time_ns", lambda: written_ns)
    run = plan("native.sim.yml")
    keys = RunKeys([run.source.path], OPTIONS, [])
    edited("rock.obj")
    assert keys.of(run) is None
    keys.close()


@pytest.mark.parametrize("name", ["notes", "rock.obj", "native.sim.yml", "link", ".git/../notes"])
def test_code_may_read_files_of_git_and_of_the_scenario(folder: Path, name: str) -> None:
    Path("link").symlink_to("notes")
    run = plan("native.sim.yml")
    keys = RunKeys([run.source.path], OPTIONS, [])
    assert keys.of(run, [str(folder / name)]) == keys.of(run) is not None
    assert keys.unknown(run) is None


@pytest.mark.parametrize("name", ["ignored", "none", "..", ".", "/etc/passwd", "link", "notes/none", "a\0b"])
def test_a_run_that_reads_another_file_has_no_key(folder: Path, name: str) -> None:
    edited("ignored")
    Path("link").symlink_to("ignored")
    run = plan("native.sim.yml")
    keys = RunKeys([run.source.path], OPTIONS, [])
    assert keys.of(run, [str(folder / "notes"), str(folder / name)]) is None
    assert keys.of(run, None) is None


def test_the_reason_is_known_if_the_workspace_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", os.devnull)
    run = plan("scripted.sim.yml")
    assert "git was not found" in (RunKeys([run.source.path], OPTIONS, []).unknown(run) or "")


def test_the_samples_of_a_table_belong_to_the_key(folder: Path) -> None:
    Path("ignored").write_text("friction\n0.5\n", encoding="utf-8")
    text = f"{NATIVE}variations: {{world.ground.friction: {{csv: ignored, column: friction}}}}\n"
    Path("native.sim.yml").write_text(text, encoding="utf-8")
    before = native()
    assert before == native() is not None
    Path("ignored").write_text("friction\n0.6\n", encoding="utf-8")
    assert native() not in (before, None)
