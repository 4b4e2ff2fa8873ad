"""`run --resume` as people have it: a run that was killed, and a second one that continues it."""

from __future__ import annotations

import json
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from sim_action.results.journal_seal import Seal
from tests.integration.conftest import outside_of_github, sim_action
from tests.soak import soaked

SWEEP = """\
name: burger drives
robot: {{model: turtlebot3_burger}}
commands: {{rate: 10 Hz, twist: [{{linear: 1.0}}]}}
expect: [{{travel: {{at_least: 10 cm}}}}]
time_limit: 0.2 s
variations: {{expect.0.travel.at_least: {limits}}}
"""
ONE = """\
name: {name}
robot: {{model: turtlebot3_burger}}
commands: {{rate: 10 Hz, {commands}}}
expect: [{{travel: {{at_least: 1 cm}}}}]
time_limit: 0.3 s
"""
TWIST = "twist: [{linear: 1.0}]"
DRIVES = """\
import os
from sim_action import Twist

HERE = os.path.dirname(os.path.abspath(__file__))


def control(observation):
    return Twist.planar(1.0, 0.0)
"""
JOURNAL = Path("sim-results/results.jsonl")
# As a killed call has it: a verdict is taken over only if the variables of Python are the same.
VARIABLES = {"PYTHONDONTWRITEBYTECODE": "1"}


def run(folder: Path, *arguments: str, **variables: str) -> str:
    """A whole call: what it prints."""
    found = sim_action(folder, "run", *arguments, **{**VARIABLES, **variables})
    assert found.returncode in (0, 1), found.stdout + found.stderr
    return found.stdout + found.stderr


def killed(folder: Path, finished: int, *arguments: str) -> None:
    """A call that is killed once its journal has so many verdicts, or at its end."""
    command = [sys.executable, "-P", "-m", "sim_action", "run", *arguments]
    streams: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, cwd=folder, env=outside_of_github(VARIABLES), **streams) as process:
        while process.poll() is None and verdicts(folder) < finished:
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)


def verdicts(folder: Path) -> int:
    try:
        return (folder / JOURNAL).read_bytes().count(b'"event":"finished"')
    except FileNotFoundError:
        return 0


def records(folder: Path, event: str = "finished") -> list[dict[str, Any]]:
    lines = [json.loads(line) for line in (folder / JOURNAL).read_text(encoding="utf-8").splitlines()]
    return [line for line in lines if line.get("event") == event]


def taken_over(folder: Path) -> list[str]:
    """The names of the scenarios that were not run again."""
    return sorted(each["outcome"]["name"] for each in records(folder) if each.get("taken_over"))


def without_times(data: Any) -> Any:
    if isinstance(data, dict):
        return {
            key: without_times(each)
            for key, each in data.items()
            if key not in ("started_at", "wall_time", "real_time_factor")
        }
    return [without_times(each) for each in data] if isinstance(data, list) else data


def results(folder: Path) -> Any:
    return without_times(json.loads((folder / "sim-results/results.json").read_text(encoding="utf-8")))


def different(found: Any, expected: Any) -> dict[str, list[tuple[Any, Any]]]:
    """The keys of the results or of an outcome -> what was found, and what was expected."""
    outcomes = list(zip(found.pop("outcomes"), expected.pop("outcomes"), strict=True))
    pairs = {"results": (found, expected)} | {each["name"]: (each, other) for each, other in outcomes}
    return {
        name: [(one.get(key), other.get(key)) for key in one | other if one.get(key) != other.get(key)]
        for name, (one, other) in pairs.items()
        if one != other
    }


def files(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in (folder / "sim-results").rglob("*") if path.is_file()}


def git(folder: Path, *words: str) -> None:
    subprocess.run(["git", *words], cwd=folder, check=True, capture_output=True)


def suite(folder: Path, **commands: str) -> Path:
    """A repository with a scenario for each command source. It ignores all files: only those that they name count."""
    folder.mkdir(exist_ok=True)
    git(folder, "init", "-q")
    (folder / ".git/info/exclude").write_text("*")
    for name, source in commands.items():
        (folder / f"{name}.sim.yml").write_text(ONE.format(name=name, commands=source), encoding="utf-8")
    return folder


def repository(folder: Path, files: Mapping[str, str]) -> Path:
    for name, text in {".gitignore": "ignored*\n", **files}.items():
        (folder / name).write_text(text, encoding="utf-8")
    git(folder, "init", "-q")
    git(folder, "add", ".")
    return folder


@pytest.mark.parametrize(("count", "kills"), soaked([(20, 2), (300, 4)], short=[(20, 2)]))
def test_a_sweep_that_is_killed_and_resumed_gives_the_same_results(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], count: int, kills: int
) -> None:
    seed = random.SystemRandom().randrange(2**32)
    chosen = random.Random(seed)
    for name in ("whole", "resumed"):
        limits = [round(0.002 * number, 4) for number in range(1, count + 1)]
        suite(tmp_path / name)
        (tmp_path / name / "sweep.sim.yml").write_text(SWEEP.format(limits=limits), encoding="utf-8")
    # One folder after the other has the same path.
    folder = tmp_path / "resumed"
    run(folder)
    whole, stored = results(folder), files(folder)
    shutil.rmtree(folder / "sim-results")
    known = []
    for _ in range(kills):
        killed(folder, chosen.randrange(count), "--resume")
        known.append(verdicts(folder))
    printed = run(folder, "--resume")
    with capsys.disabled():
        sys.stdout.write(f"\n{count} runs, seed {seed}: verdicts before kills {known}\n")
    assert len(whole["outcomes"]) == count
    assert {outcome["status"] for outcome in whole["outcomes"]} == {"passed", "failed"}
    assert different(results(folder), whole) == {}
    assert files(folder) == stored
    assert len(taken_over(folder)) >= known[-1], printed
    assert f"{len(taken_over(folder))} of {count} scenarios taken over from the earlier run" in printed


def test_everything_is_taken_over_but_what_a_change_may_concern(tmp_path: Path) -> None:
    folder = suite(tmp_path, a=TWIST, b=TWIST)
    run(folder)
    before, traces = results(folder), {path: path.stat().st_mtime_ns for path in folder.rglob("*.npz")}
    assert "2 of 2 scenarios taken over from the earlier run" in run(folder, "--resume")
    assert results(folder) == before
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*.npz")} == traces
    suite(tmp_path, b="twist: [{linear: 0.5}]")
    run(folder, "--resume")
    assert taken_over(folder) == ["a"]
    assert "no verdict of the earlier run is taken over" in run(folder, "--resume", "--seed", "7")
    assert "2 of 2 scenarios" in run(folder, "--resume", SIM_ACTION_SEED="7")
    assert "taken over" not in run(folder)
    # Files that nobody needs are removed.
    (folder / "b.sim.yml").unlink()
    run(folder, "--resume", "--no-report")
    left = (".gitignore", "results.json", "results.jsonl", "junit.xml", "traces/a.npz")
    assert files(folder) == {f"sim-results/{name}" for name in left}


def cut(journal: Path) -> None:
    whole = journal.read_bytes()
    lines = whole.splitlines(keepends=True)
    journal.write_bytes(b"".join(lines[:-2]) + lines[-2][:50])


def fill_with_garbage(journal: Path) -> None:
    header, *lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(header + b"\xff\n[]\n{}\n" + b"[" * 10_000 + b"\n" + b"".join(lines))


def link_trace(journal: Path) -> None:
    trace = journal.parent / "traces/a.npz"
    trace.rename(journal.parent / "a.npz")
    trace.symlink_to(journal.parent / "a.npz")


# What is done to a journal and to what lies beside it -> the verdicts that are taken over all the same.
DAMAGES: dict[str, tuple[Callable[[Path], object], list[str]]] = {
    "cut": (cut, ["a"]),
    "garbage": (fill_with_garbage, ["a", "b"]),
    # A pass with an expectation that failed.
    "forged": (lambda path: path.write_bytes(path.read_bytes().replace(b'"passed":true', b'"passed":false')), []),
    "no trace": (lambda path: (path.parent / "traces/a.npz").unlink(), ["b"]),
    "a linked trace": (link_trace, ["b"]),
    "no replay": (lambda path: (path.parent / "replays/a.json.gz").unlink(), ["b"]),
    "no journal": (Path.unlink, []),
}


@pytest.fixture(scope="module")
def earlier(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A suite that has run once, and a copy of its results."""
    folder, kept = suite(tmp_path_factory.mktemp("suite"), a=TWIST, b=TWIST), tmp_path_factory.mktemp("kept")
    run(folder, "-j1")
    return folder, shutil.copytree(folder / "sim-results", kept / "sim-results")


@pytest.mark.parametrize("damage", DAMAGES)
def test_only_valid_verdicts_are_taken_over(earlier: tuple[Path, Path], damage: str) -> None:
    (folder, kept), (act, left) = earlier, DAMAGES[damage]
    shutil.rmtree(folder / "sim-results")
    shutil.copytree(kept, folder / "sim-results")
    before = results(folder)
    act(folder / JOURNAL)
    printed = run(folder, "--resume")
    assert taken_over(folder) == left
    assert f"{len(left)} of 2 scenarios taken over" in printed
    assert "Traceback" not in printed
    assert results(folder) == before


def test_a_journal_that_is_a_link_is_refused_and_not_taken_over(tmp_path: Path) -> None:
    folder = suite(tmp_path, a=TWIST)
    run(folder, "-j1")
    before = results(folder)
    elsewhere = (folder / JOURNAL).rename(folder / "elsewhere.jsonl")
    (folder / JOURNAL).symlink_to(elsewhere)
    text = elsewhere.read_bytes()
    found = sim_action(folder, "run", "--resume")
    assert found.returncode == 2
    assert f"'{JOURNAL}' is a link, and results are not written through links; remove it" in found.stderr
    assert "Traceback" not in found.stderr
    assert (elsewhere.read_bytes(), results(folder)) == (text, before)
    # The link is removed, as the message says.
    (folder / JOURNAL).unlink()
    run(folder, "--resume")
    assert taken_over(folder) == []
    assert (elsewhere.read_bytes(), results(folder)) == (text, before)


def test_a_part_of_the_scenarios_takes_over_its_part(tmp_path: Path) -> None:
    folder = suite(tmp_path, a=TWIST, b=TWIST, c=TWIST)
    run(folder)
    assert "2 of 2 scenarios taken over" in run(folder, "--resume", "--only", "a", "--only", "c")
    assert "2 of 3 scenarios taken over" in run(folder, "--resume")
    assert "1 of 1 scenario taken over" in run(folder, "--resume", "--shard", "2/3")


def test_a_comparison_of_engines_is_taken_over_as_a_whole(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    folder = suite(tmp_path, a=TWIST, b=TWIST)
    run(folder, "--backend", "all")
    before = results(folder)
    assert "4 of 4 scenarios taken over" in run(folder, "--backend", "all", "--resume")
    assert results(folder) == before
    (folder / "sim-results/traces/a-mujoco.npz").unlink()
    run(folder, "--backend", "all", "--resume")
    assert taken_over(folder) == ["b [mujoco]", "b [pybullet]"]
    assert results(folder) == before


def test_a_failure_that_is_taken_over_is_the_first_with_fail_fast(tmp_path: Path) -> None:
    folder = suite(tmp_path, a="twist: [{linear: 0.0}]", b=TWIST)
    run(folder)
    (folder / "b.sim.yml").write_text(ONE.format(name="b", commands=TWIST) + "seed: 3\n")
    assert "1 failed, 1 not run" in run(folder, "--resume", "--fail-fast")
    assert taken_over(folder) == ["a"]


READS = """\
import asyncio, decimal, json, tempfile, uuid, numpy, helper
open(HERE + "/data.txt").read()
open(HERE + "/ignored.log", "w").write("1")
open(HERE + "/ignored.log").read()
tempfile.mkdtemp(), tempfile.TemporaryFile().write(b"1"), os.urandom(4), os.listdir(HERE)
"""
READERS = {"plain": "", "reads": READS}
# tests/runner/test_observed_inputs.py has more.
OUTSIDERS = {"ignored": "open(HERE + '/ignored.txt').read()", "aborted": "os.abort()"}


@pytest.mark.skipif(sys.platform != "linux", reason="files of Linux")
def test_code_that_may_read_anything_runs_again(tmp_path: Path) -> None:
    files = {"data.txt": "1", "helper.py": "", "ignored.txt": "1"}
    for name, line in (READERS | OUTSIDERS).items():
        files[f"u_{name}.py"] = f"{DRIVES}\n\n{line}\n"
        files[f"{name}.sim.yml"] = ONE.format(name=name, commands=f"script: u_{name}.py")
    folder = repository(tmp_path, files)
    run(folder)
    before = results(folder)
    assert [each["name"] for each in before["outcomes"] if each["status"] != "passed"] == ["aborted"]
    run(folder, "--resume")
    assert taken_over(folder) == sorted(READERS)
    assert results(folder) == before
    # A new file: a call waits if a folder has just been changed, and not if a file has that no scenario names.
    (folder / "data.txt").unlink()
    (folder / "data.txt").write_text("2")
    # No verdict of the others was taken over before.
    printed = run(folder, "--resume", *(f"--only={name}" for name in READERS))
    assert len(records(folder)) == len(READERS)
    assert taken_over(folder) == []
    assert "no verdict of the earlier run is taken over" in printed


def forged(folder: Path, *, resealed: bool = False) -> None:
    """Run a scenario that fails, and make its journal and traces say that it passed.

    `resealed`: with a seal, as if the stranger had the key; then only the place of the journal is in the way.
    """
    sim_action(folder, "run", "sim", "--no-report")
    lines = []
    for written in (folder / JOURNAL).read_bytes().splitlines(keepends=True):
        data, line = json.loads(written), written
        if data.get("event") == "finished":
            outcome = data["outcome"]
            outcome["status"] = "passed"
            outcome.pop("failures", None)
            for expectation in outcome["expectations"]:
                expectation["verdict"]["passed"] = True
                expectation["verdict"]["margin"] = 1.0
            del data["seal"]
            line = json.dumps(data).encode() + b"\n"
            seal = Seal.of_user() if resealed else Seal(b"a key of the stranger")
            assert seal is not None
            line = seal.on(line)
        lines.append(line)
    (folder / JOURNAL).write_bytes(b"".join(lines))
    for name in ("results.json", "junit.xml", ".gitignore"):
        (folder / "sim-results" / name).unlink()


STANDS = "twist: [{linear: 0.0}]"
OF_JOB = {"GITHUB_ACTIONS": "true", "GITHUB_EVENT_NAME": "pull_request"}


def test_a_journal_of_the_checkout_is_not_believed(tmp_path: Path) -> None:
    """Not even with our seal; tests/results/test_journal_seal.py has other checkouts."""
    suite(tmp_path / "sim", a=STANDS)
    shutil.rmtree(tmp_path / "sim/.git")
    forged(tmp_path, resealed=True)
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", "-Af")
    printed = sim_action(tmp_path, "run", "sim", "--no-report", "--resume", **OF_JOB, GITHUB_WORKSPACE=str(tmp_path))
    assert printed.returncode == 1, printed.stdout + printed.stderr
    assert "0 of 1 scenario taken over" in printed.stdout + printed.stderr
    assert "belongs to the git repository" in printed.stderr
    assert results(tmp_path)["outcomes"][0]["status"] == "failed"


@pytest.mark.parametrize(
    ("removed", "reason"),
    [
        ((), "1 verdict of the earlier run without a valid seal; the scenarios run again"),
        (("seal", "key"), "its journal does not say which files and options they depend on"),
    ],
)
def test_a_journal_without_our_seal_runs_again(tmp_path: Path, removed: tuple[str, ...], reason: str) -> None:
    """It is not tracked, as after a download, and everything else about it is right."""
    suite(tmp_path / "sim", a=STANDS)
    shutil.rmtree(tmp_path / "sim/.git")
    git(tmp_path, "init", "-q")
    forged(tmp_path)
    records = [json.loads(line) for line in (tmp_path / JOURNAL).read_text().splitlines()]
    kept = [{key: value for key, value in record.items() if key not in removed} for record in records]
    (tmp_path / JOURNAL).write_text("".join(json.dumps(record) + "\n" for record in kept))
    assert reason in run(tmp_path, "sim", "--no-report", "--resume")
    assert results(tmp_path)["outcomes"][0]["status"] == "failed"
    assert taken_over(tmp_path) == []
