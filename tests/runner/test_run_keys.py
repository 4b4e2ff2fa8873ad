"""Keys of runs: each input that an outcome may depend on changes them, and no other one does."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sim_action.core.permissions import Permissions
from sim_action.results.artifacts import run_files
from sim_action.results.journal import JOURNAL_FILE, Event, Finished, Header, Journal, RunEnded
from sim_action.results.outcome import Failure, Outcome, Repeats, Status
from sim_action.runner import run_keys as module
from sim_action.runner.child_outcome import engine_provenance
from sim_action.runner.outcome_assembly import OutcomeAssembly, planned_outcomes
from sim_action.runner.run_keys import RunKeys, RunOptions, TakenOver, take_over
from sim_action.runner.run_plan import engine_runs
from sim_action.scenario.files import read_file
from sim_action.scenario.loading import checked
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.source import Source
from tests.outcomes import outcome as passed
from tests.scenarios import LEAST, load

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


@pytest.fixture(scope="module")
def repository(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("repository")
    files = {"native.sim.yml": NATIVE, "rock.obj": ROCK, "scripted.sim.yml": SCRIPTED, "drive.py": DRIVE, "notes": ""}
    for name, text in {**files, ".gitignore": "rock.obj\nignored\n"}.items():
        (folder / name).write_text(text, encoding="utf-8")
    for words in (("init", "-q"), ("add", ".")):
        subprocess.run(["git", *words], cwd=folder, check=True, capture_output=True)
    return folder


@pytest.fixture(autouse=True)
def folder(repository: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The root of a repository; its files were written long ago."""
    now = time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: now() + 3_600_000_000_000)
    monkeypatch.chdir(tmp_path)
    shutil.copytree(repository, tmp_path, symlinks=True, dirs_exist_ok=True)
    return tmp_path


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
    assert re.fullmatch(rf"[0-9a-f]{{64}}:(?:[0-9a-f]{{8}}\.){{{len(module._PARTS) - 1}}}[0-9a-f]{{8}}", first)
    assert kind() == first


@KINDS
def test_a_workspace_that_was_renamed_keeps_its_keys(kind: Kind, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = kind()
    renamed = folder.rename(folder.with_name(f"{folder.name}-renamed"))
    monkeypatch.chdir(renamed)
    assert kind() == first is not None


def test_which_files_of_a_scenario_count(folder: Path) -> None:
    assert native() != scripted()
    before, other = native(), scripted()
    edited("rock.obj")
    assert native() != before
    assert scripted() == other
    edited("ignored")
    assert scripted() == other
    before = scripted()
    edited("scripted.sim.yml", "environment: {MY_ROBOT: fast}\n")
    assert scripted() not in (None, before)
    Path("ignored").write_text("friction\n0.5\n", encoding="utf-8")
    text = f"{NATIVE}variations: {{world.ground.friction: {{csv: ignored, column: friction}}}}\n"
    Path("native.sim.yml").write_text(text, encoding="utf-8")
    before = native()
    assert before == native() is not None
    Path("ignored").write_text("friction\n0.6\n", encoding="utf-8")
    assert native() not in (before, None)


@KINDS
@pytest.mark.parametrize("name", ["native.sim.yml", "scripted.sim.yml", "drive.py", "notes"])
def test_every_file_that_git_sees_counts(kind: Kind, name: str) -> None:
    before = kind()
    edited(name)
    assert kind() != before


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


def test_variables_for_user_code(monkeypatch: pytest.MonkeyPatch) -> None:
    # Other variables count for user code.
    before, other = scripted(), native()
    monkeypatch.setenv("ROS_DISTRO", "fast")
    assert scripted() != before
    assert native() == other
    # Secrets do not count because code does not see them.
    before = scripted()
    for name in ("GH_TOKEN", "ROS_TOKEN", "MY_ROBOT", "DATABASE_URL"):
        monkeypatch.setenv(name, "secret")
    assert scripted() == before


def test_passed_variables_count_for_user_code(monkeypatch: pytest.MonkeyPatch) -> None:
    passing = RunOptions(Permissions(pass_env=("MY_ROBOT",)))
    before, other = key(options=passing), key(plan("native.sim.yml"), passing)
    monkeypatch.setenv("MY_ROBOT", "fast")
    assert key(options=passing) not in (None, before)
    assert key(plan("native.sim.yml"), passing) == other


@KINDS
def test_variables_of_native_code_count(kind: Kind, monkeypatch: pytest.MonkeyPatch) -> None:
    before = kind()
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    assert kind() != before


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


def test_options_of_the_call_and_of_variations() -> None:
    # The order of formats does not count.
    one, other = (RunOptions(Permissions(), formats=formats) for formats in (("csv", "tum"), ("tum", "csv")))
    assert key(options=one) == key(options=other)
    # The rate of the trace counts.
    run = plan("native.sim.yml")
    assert key(run.traced_at_every_step()) != key(run)
    # Nothing has a key while golden files are written.
    options = RunOptions(Permissions(updates_golden=True))
    assert key(plan("native.sim.yml", options), options) is None


@pytest.mark.parametrize(
    "changes",
    [{"seed": 1}, {"unexercised": "warn"}, {"name": "another"}, {"backend": "mujoco"}],
    ids=["seed", "unexercised", "name", "engine"],
)
def test_values_of_the_command_line_count(changes: dict[str, object]) -> None:
    run = plan("native.sim.yml", engine="pybullet")
    other = replace(run, scenario=run.scenario.model_copy(update=changes))
    assert key(other) not in (None, key(run))


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


CRASH = Failure(kind="crash", title="SIGSEGV", message="it crashed")
FLAKY = Failure(kind="flaky", title="flaky", message="1 of 2 runs agree")


class Keys:
    """Keys that are the names of scenarios; `unknown_names` have none."""

    def __init__(self, *unknown_names: str, short: str = "") -> None:
        self._unknown, self._short = unknown_names, short

    def of(self, loaded: LoadedScenario) -> str | None:
        name = loaded.scenario.name
        return None if name in self._unknown else f"key of {name}{self._short and ':'}{self._short}"

    def unknown(self, _loaded: LoadedScenario) -> str | None:
        return "git is missing" if self._unknown else None


class Call:
    """A call that runs scenarios with names, with an earlier call in its folder."""

    def __init__(self, folder: Path, names: Sequence[str] = ("a", "b"), repeat: int = 1) -> None:
        self.folder, self.repeat = folder, repeat
        self.runs = [load(folder, LEAST.replace("burger drives straight", name)) for name in names]
        plans = [(run,) for run in self.runs]
        self.events: list[Event] = []
        self.assembly = OutcomeAssembly(plans, repeat, folder, None, self.events.append)
        self.planned = planned_outcomes(plans, [])
        self.files = run_files(list(names) * repeat, folder, replays=False, formats=())
        for run in self.files:
            run.trace.parent.mkdir(exist_ok=True)
            run.trace.write_bytes(b"trace")

    def outcome(self, place: int, turn: int = 1, **changes: Any) -> Outcome:
        trace = self.files[(turn - 1) * len(self.runs) + place].trace.relative_to(self.folder).as_posix()
        own = {name: getattr(self.planned[place], name) for name in ("name", "file", "line", "number")}
        return passed("s.sim.yml").model_copy(
            update={**own, "trace": trace, "replay": None, "recordings": (), **changes}
        )

    def journal(self, *events: Event) -> None:
        header = Header.of_call(self.planned, ())
        journal = Journal(self.folder, header, pytest.fail, time.monotonic())
        for event in events:
            journal(event)
        journal.close()

    def taken(self, keys: Keys | None = None) -> TakenOver:
        known = cast("RunKeys", keys or Keys())
        return take_over(self.folder, self.planned, self.runs, self.assembly, files=self.files, keys=known)


@pytest.fixture
def call(tmp_path: Path) -> Call:
    return Call(tmp_path)


def taken_places(found: TakenOver) -> list[tuple[int | None, int | None]]:
    return [(record.place, record.turn) for record in found.records]


def test_a_verdict_with_an_equal_key_is_taken_over(call: Call) -> None:
    call.journal(Finished(0, call.outcome(0), "key of a"), Finished(1, call.outcome(1), "another"))
    found = call.taken()
    assert taken_places(found) == [(0, None)]
    assert found.files == {"traces/a.npz"}
    assert (found.finals, found.runs(1), found.not_passed, found.remarks) == (1, 1, False, ())


def test_its_place_is_that_of_this_call(tmp_path: Path) -> None:
    earlier = Call(tmp_path, ("b", "a"))
    earlier.journal(Finished(1, earlier.outcome(1), "key of a"))
    assert taken_places(Call(tmp_path, ("a",)).taken()) == [(0, None)]


@pytest.mark.parametrize(
    ("status", "failures", "is_taken"),
    [("passed", (), True), ("error", (CRASH,), False), ("skipped", (), False), ("failed", (), False)],
)
def test_valid_verdicts_count(call: Call, status: Status, failures: tuple[Failure, ...], *, is_taken: bool) -> None:
    expectations = call.outcome(0).expectations if status in ("passed", "failed") else ()
    changed = call.outcome(0, status=status, failures=failures, expectations=expectations)
    call.journal(Finished(0, changed, "key of a"))
    assert bool(call.taken().records) is is_taken


@pytest.mark.parametrize(
    "changes",
    [
        {"line": 7},
        {"number": 2},
        {"group": "another"},
        {"trace": None},
        {"trace": "traces/b.npz"},
        {"trace": "../traces/a.npz"},
        {"trace": "/etc/passwd"},
        {"replay": "replays/a.json.gz"},
        {"recordings": ("recordings/a.csv",)},
    ],
)
def test_it_has_the_attributes_and_the_files_of_the_plan(call: Call, changes: dict[str, Any]) -> None:
    call.journal(Finished(0, call.outcome(0, **changes), "key of a"))
    assert call.taken().records == ()


@pytest.mark.parametrize("damage", ["missing", "empty", "link"])
def test_its_files_exist(call: Call, damage: str) -> None:
    trace = call.files[0].trace
    trace.unlink()
    if damage == "empty":
        trace.touch()
    elif damage == "link":
        trace.symlink_to(call.files[1].trace)
    call.journal(Finished(0, call.outcome(0), "key of a"))
    assert call.taken().records == ()


def test_runs_without_a_key_run_again_and_the_reason_is_given(call: Call) -> None:
    call.journal(Finished(0, call.outcome(0), None), Finished(1, call.outcome(1), "key of b"))
    found = call.taken(Keys("a"))
    assert taken_places(found) == [(1, None)]
    assert found.remarks == ("verdicts of user code are not taken over: git is missing",)


def test_a_call_in_which_all_has_changed_says_so(call: Call) -> None:
    call.journal(Finished(0, call.outcome(0), "another:1.2.9.4.5.6.7.8.9"))
    (remark,) = call.taken(Keys(short="1.2.3.4.5.0.7.8.9")).remarks
    assert remark == (
        "no verdict of the earlier run is taken over: since then, these have changed: files that scenarios name, "
        "Python or its packages"
    )
    (remark,) = Call(call.folder, ("another",)).taken().remarks
    assert "it has none of these scenarios" in remark


def test_without_a_journal_there_is_nothing_to_resume(call: Call) -> None:
    assert call.taken().records == ()
    assert "there is no earlier run to resume: " in call.taken().remarks[0]


def test_repetitions_are_taken_over_one_by_one(tmp_path: Path) -> None:
    call = Call(tmp_path, repeat=2)
    call.journal(
        RunEnded(0, 1, call.outcome(0), "key of a", is_one_of_several=True),
        RunEnded(1, 1, call.outcome(1), None, is_one_of_several=True),
        RunEnded(0, 2, call.outcome(0, 2, status="error", expectations=(), failures=(CRASH,)), "key of a"),
    )
    found = call.taken()
    assert taken_places(found) == [(0, 1)]
    assert (found.finals, found.runs(2)) == (0, 1)
    call.assembly.take_over(found.records)
    assert call.assembly.ended == {(0, 1)}
    (event,) = call.events
    assert isinstance(event, RunEnded)
    assert event.taken_over
    assert event.is_one_of_several


@pytest.mark.parametrize("traces", [1, 2])
def test_a_flaky_scenario_keeps_the_traces_of_both_runs(tmp_path: Path, traces: int) -> None:
    call = Call(tmp_path, ("a",), repeat=3)
    repeats = Repeats(count=3, agreed=2, digests=2)
    flaky: dict[str, Any] = {"status": "flaky", "failures": (FLAKY,), "expectations": (), "repeats": repeats}
    for run in call.files[traces:]:
        run.trace.unlink()
    call.journal(Finished(0, call.outcome(0, **flaky), "key of a"))
    found = call.taken()
    assert found.finals == traces - 1
    assert found.runs(3) == 3 * (traces - 1)
    assert found.not_passed is (traces == 2)


def test_final_outcomes_are_reported_as_taken_over(call: Call) -> None:
    call.journal(Finished(0, call.outcome(0), "key of a"))
    call.assembly.take_over(call.taken().records)
    assert call.events == [Finished(0, call.outcome(0), "key of a", taken_over=True)]
    assert call.assembly.ended == {(0, 1)}
    call.assembly.end([call.outcome(0), call.outcome(1)])
    assert [event.place for event in call.events if isinstance(event, Finished)] == [0, 1]


def test_a_key_of_repetitions_is_that_of_all(tmp_path: Path) -> None:
    call = Call(tmp_path, repeat=2)
    for place, keys in enumerate((("key", "key"), ("key", None))):
        for turn, key in enumerate(keys, start=1):
            call.assembly(RunEnded(place, turn, call.outcome(place, turn), key))
    assert [event.key for event in call.events if isinstance(event, Finished)] == ["key", None]


@settings(suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@given(place=st.integers(0, 5_000), byte=st.integers(0, 255))
def test_a_changed_byte_makes_no_other_verdict(tmp_path_factory: pytest.TempPathFactory, place: int, byte: int) -> None:
    call = Call(tmp_path_factory.mktemp("call"), ("a",))
    call.journal(Finished(0, call.outcome(0), "key of a"))
    journal = call.folder / JOURNAL_FILE
    data = bytearray(journal.read_bytes())
    data[place % len(data)] = byte
    journal.write_bytes(data)
    outcomes = [record.outcome for record in call.taken().records]
    assert [outcome.status for outcome in outcomes if outcome is not None] in ([], ["passed"])
