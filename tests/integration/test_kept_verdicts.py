"""A scenario that harms its surroundings loses no verdict, neither its own nor that of another scenario."""

from __future__ import annotations

import sys
from itertools import product
from pathlib import Path
from typing import Final

import pytest

from sim_action.core.errors import Location
from sim_action.engines import installed
from sim_action.results.outcome import Failure, Outcome
from sim_action.results.results_json import Results
from tests.integration.conftest import sim_action
from tests.soak import soaked

SCENARIO: Final = """\
name: {name}
robot: {{model: turtlebot3_burger}}
commands: {{script: {name}.py}}
expect: [{{travel: {{at_least: 0.1 m}}}}]
time_limit: 5 s
"""
DRIVES: Final = """\
import os, pathlib, shutil, sys, tempfile, time
from sim_action import Twist
{before}
def control(observation):
{body}
    return Twist.planar(0.5)
"""
ONCE: Final = "if observation.time == 0: "


def write(folder: Path, name: str, body: str = "pass", before: str = "") -> None:
    lines = "\n".join(f"    {line}" for line in body.splitlines())
    (folder / f"{name}.py").write_text(DRIVES.format(before=before, body=lines))
    (folder / f"{name}.sim.yml").write_text(SCENARIO.format(name=name))


def run(folder: Path, *arguments: str, code: int = 0, **environment: str) -> dict[str, Outcome]:
    """Run the scenarios of a folder, and return the outcomes by name."""
    ran = sim_action(folder, "run", ".", "--output-dir", "out", *arguments, **environment)
    assert ran.returncode == code, ran.stdout + ran.stderr
    assert "Traceback" not in ran.stderr
    return {outcome.name: outcome for outcome in Results.read(folder / "out/results.json").outcomes}


def failure(outcome: Outcome) -> Failure:
    (found,) = outcome.failures
    return found


def remarks(outcome: Outcome) -> list[str]:
    """The notes, without that on the drive."""
    return [note for note in outcome.notes if not note.startswith("recognised")]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere, these files lie in the scratch folder")
def test_a_script_that_removes_all_scratch_folders_harms_no_verdict(tmp_path: Path) -> None:
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    remove = "for each in pathlib.Path(os.environ['TMPDIR']).glob('sim-action-*'): shutil.rmtree(each)"
    write(tmp_path, "remover", remove)
    write(tmp_path, "other", "print('printed')")
    (tmp_path / "plain.sim.yml").write_text(
        SCENARIO.format(name="plain").replace("{script: plain.py}", "{twist: [{linear: 0.5}]}")
    )
    found = run(tmp_path, "--jobs", "3", TMPDIR=str(scratch))
    assert {outcome.status for outcome in found.values()} == {"passed"}
    assert "printed" in found["other"].output
    assert list(scratch.iterdir()) == []


def test_a_scenario_has_its_scratch_folder_while_it_runs(tmp_path: Path) -> None:
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    for name in ("a", "b"):
        write(tmp_path, name, f"{ONCE}print(len(list(pathlib.Path({str(scratch)!r}).iterdir())), tempfile.mkdtemp())")
    found = run(tmp_path, "--jobs", "1", TMPDIR=str(scratch))
    for outcome in found.values():
        number, folder = outcome.output.split()
        assert number == "1"
        assert Path(folder).is_relative_to(scratch)
    assert list(scratch.iterdir()) == []


GOES: Final = {
    "to its folder": "os.chdir(os.path.dirname(__file__))",
    "to proc": "os.chdir('/proc')",
    "to a removed folder": "gone = tempfile.mkdtemp(); os.chdir(gone); os.rmdir(gone)",
}


@pytest.mark.skipif(sys.platform == "win32", reason="a current folder cannot be removed")
@pytest.mark.parametrize("where", soaked(GOES, short=["to a removed folder"]))
def test_a_script_that_goes_elsewhere_leaves_its_files_in_the_output_folder(tmp_path: Path, where: str) -> None:
    (tmp_path / "deep").mkdir()
    write(tmp_path / "deep", "goes", before=GOES[where])
    found = run(tmp_path, "--record", "csv")
    assert found["goes"].status == "passed"
    assert remarks(found["goes"]) == []
    files = (found["goes"].trace, found["goes"].replay, *found["goes"].recordings)
    assert files == ("traces/goes.npz", "replays/goes.json.gz", "recordings/goes.csv")
    assert all((tmp_path / "out" / str(name)).is_file() for name in files)
    assert list((tmp_path / "deep").rglob("*.npz")) == []


KINDS: Final = {"npz": "trace", "json.gz": "replay", "csv": "recording"}


@pytest.mark.skipif(sys.platform == "win32", reason="the system gives other reasons")
@pytest.mark.parametrize(
    ("ending", "reason"),
    soaked(
        product(KINDS, ["exists", "is a directory"]),
        short=[("npz", "exists"), ("json.gz", "is a directory"), ("csv", "exists")],
    ),
)
def test_evidence_that_cannot_be_written_is_a_note(tmp_path: Path, ending: str, reason: str) -> None:
    kinds, out = KINDS, tmp_path / "out"
    folder = out / f"{kinds[ending]}s"
    if reason == "exists":
        block = f"{str(out)!r}).mkdir(exist_ok=True); pathlib.Path({str(folder)!r}).write_text('')"
    else:
        block = f"{str(folder / f'it.{ending}')!r}).mkdir(parents=True)"
    write(tmp_path, "it", f"{ONCE}pathlib.Path({block}")
    outcome = run(tmp_path, "--record", "csv")["it"]
    assert outcome.status == "passed"
    (note,) = remarks(outcome)
    assert note.startswith(kinds[ending])
    assert reason in note
    named = {"trace": outcome.trace, "replay": outcome.replay, "recording": outcome.recordings or None}
    assert [kind for kind, file in named.items() if file is None] == [kinds[ending]]
    assert [path.name for path in out.rglob(".*") if path.is_file()] == [".gitignore"]


def test_a_text_that_is_no_unicode_is_escaped(tmp_path: Path) -> None:
    write(tmp_path, "it", "raise ValueError('cannot read map \\udcff.pgm')")
    found = failure(run(tmp_path, code=1)["it"])
    assert found.title == "script error"
    assert found.message.endswith("the controller raised ValueError: cannot read map \\udcff.pgm")
    assert found.location == Location("it.py", 5)


SILENT_LEAK: Final = """\
try:
    while True: leaked.append(os.open(os.devnull, 0))
except OSError:
    pass
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there is no such limit")
@pytest.mark.parametrize(
    ("at_import", "engine"),
    soaked(product([True, False], installed()), short=zip([True, False], (installed() * 2)[:2], strict=True)),
)
def test_exhausted_descriptors_cost_no_verdict(tmp_path: Path, at_import: bool, engine: str) -> None:
    before = "leaked = []"
    if at_import:
        write(tmp_path, "it", before=f"{before}\n{SILENT_LEAK}")
    else:
        write(tmp_path, "it", SILENT_LEAK, before)
    outcome = run(tmp_path, "--backend", engine, "--record", "csv")["it"]
    assert outcome.status == "passed"
    assert remarks(outcome) == []
    assert None not in (outcome.trace, outcome.replay)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere, these files lie in the scratch folder")
def test_a_process_that_is_killed_while_it_records_keeps_its_verdict(tmp_path: Path) -> None:
    kill = (
        "import sim_action.recording.export.csv_tum as made\nmade.CsvTable.write = lambda *_: os.kill(os.getpid(), 9)"
    )
    write(tmp_path, "it", before=kill)
    outcome = run(tmp_path, "--record", "csv")["it"]
    assert (outcome.status, remarks(outcome)) == ("passed", ["the recordings were cut off: SIGKILL"])
    assert outcome.recordings == ()


REMOVES: Final = {
    "its scratch folder": (f"{ONCE}shutil.rmtree(tempfile.gettempdir())", "passed"),
    "its script": (f"{ONCE}os.remove(__file__)", "passed"),
    "its folder": ("shutil.rmtree(os.path.dirname(__file__), ignore_errors=True)", "passed"),
    "the output folder": (f"shutil.rmtree({'out'!r}, ignore_errors=True)", "passed"),
}


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere, these files lie in the scratch folder")
@pytest.mark.parametrize("what", soaked(REMOVES, short=["its folder", "the output folder"]))
def test_a_script_that_removes_files_is_judged(tmp_path: Path, what: str) -> None:
    (tmp_path / "deep").mkdir()
    write(tmp_path / "deep", "it", REMOVES[what][0])
    outcome = run(tmp_path, "--record", "csv")["it"]
    assert outcome.status == REMOVES[what][1]
    assert outcome.trace is not None
    assert (tmp_path / "out" / outcome.trace).is_file()


@pytest.mark.skipif(sys.platform == "win32", reason="os.getuid is missing")
def test_a_golden_file_that_cannot_be_written_is_an_error_with_its_name(tmp_path: Path) -> None:
    write(tmp_path, "it", f"{ONCE}pathlib.Path('golden').write_text('')")
    path = tmp_path / "it.sim.yml"
    path.write_text(
        path.read_text().replace("expect: [", "expect: [{matches: {trace: golden/it.csv, position: 1 cm}}, ")
    )
    found = failure(run(tmp_path, "--update-golden", code=2)["it"])
    assert "golden/it.csv cannot be written: " in found.message
