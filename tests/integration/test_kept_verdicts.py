"""A scenario that harms its surroundings loses no verdict, neither its own nor that of another scenario."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Final

import pytest

from sim_action.core.errors import Location
from sim_action.engines import installed
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from tests.integration.conftest import sim_action
from tests.scenarios import driving
from tests.soak import soaked

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
    (folder / f"{name}.sim.yml").write_text(driving(name, f"{{script: {name}.py}}"))


def run(folder: Path, *arguments: str, code: int = 0, **environment: str) -> dict[str, Outcome]:
    """Run the scenarios of a folder, and return the outcomes by name."""
    ran = sim_action(folder, "run", ".", "--output-dir", "out", *arguments, **environment)
    assert ran.returncode == code, ran.stdout + ran.stderr
    assert "Traceback" not in ran.stderr
    return {outcome.name: outcome for outcome in Results.read(folder / "out/results.json").outcomes}


def remarks(outcome: Outcome) -> list[str]:
    """The notes, without that on the drive."""
    return [note for note in outcome.notes if not note.startswith("recognised")]


@pytest.fixture
def scratch(tmp_path: Path) -> Iterator[Path]:
    """The folder for temporary files, which is empty in the end."""
    folder = tmp_path / "scratch"
    folder.mkdir()
    yield folder
    assert list(folder.iterdir()) == []


on_linux = pytest.mark.skipif(sys.platform != "linux", reason="elsewhere, these files lie in the scratch folder")


@on_linux
def test_a_script_that_removes_all_scratch_folders_harms_no_verdict(tmp_path: Path, scratch: Path) -> None:
    remove = "for each in pathlib.Path(os.environ['TMPDIR']).glob('sim-action-*'): shutil.rmtree(each)"
    write(tmp_path, "remover", remove)
    write(tmp_path, "other", "print('printed')")
    (tmp_path / "plain.sim.yml").write_text(driving("plain"))
    ended = run(tmp_path, "--jobs", "3", TMPDIR=str(scratch))
    assert {outcome.status for outcome in ended.values()} == {"passed"}
    assert "printed" in ended["other"].output


def test_a_scenario_has_its_scratch_folder_while_it_runs(tmp_path: Path, scratch: Path) -> None:
    for name in ("a", "b"):
        write(tmp_path, name, f"{ONCE}print(len(list(pathlib.Path({str(scratch)!r}).iterdir())), tempfile.mkdtemp())")
    for outcome in run(tmp_path, "--jobs", "1", TMPDIR=str(scratch)).values():
        number, folder = outcome.output.split()
        assert number == "1"
        assert Path(folder).is_relative_to(scratch)


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
    outcome = run(tmp_path, "--record", "csv")["goes"]
    assert (outcome.status, remarks(outcome)) == ("passed", [])
    files = (outcome.trace, outcome.replay, *outcome.recordings)
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
    kind, out = KINDS[ending], tmp_path / "out"
    folder = out / f"{kind}s"
    if reason == "exists":
        block = f"{str(out)!r}).mkdir(exist_ok=True); pathlib.Path({str(folder)!r}).write_text('')"
    else:
        block = f"{str(folder / f'it.{ending}')!r}).mkdir(parents=True)"
    write(tmp_path, "it", f"{ONCE}pathlib.Path({block}")
    outcome = run(tmp_path, "--record", "csv")["it"]
    assert outcome.status == "passed"
    (note,) = remarks(outcome)
    assert note.startswith(kind)
    assert reason in note
    named = {"trace": outcome.trace, "replay": outcome.replay, "recording": outcome.recordings or None}
    assert [kind for kind, file in named.items() if file is None] == [kind]
    assert [path.name for path in out.rglob(".*") if path.is_file()] == [".gitignore"]


def test_a_text_that_is_no_unicode_is_escaped(tmp_path: Path) -> None:
    write(tmp_path, "it", "raise ValueError('cannot read map \\udcff.pgm')")
    (failure,) = run(tmp_path, code=1)["it"].failures
    assert (failure.title, failure.location) == ("script error", Location("it.py", 5))
    assert failure.message.endswith("the controller raised ValueError: cannot read map \\udcff.pgm")


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
    body, before = ("pass", SILENT_LEAK) if at_import else (SILENT_LEAK, "")
    write(tmp_path, "it", body, f"leaked = []\n{before}")
    outcome = run(tmp_path, "--backend", engine, "--record", "csv")["it"]
    assert (outcome.status, remarks(outcome)) == ("passed", [])
    assert None not in (outcome.trace, outcome.replay)


@on_linux
def test_a_process_that_is_killed_while_it_records_keeps_its_verdict(tmp_path: Path) -> None:
    kill = (
        "from sim_action.recording.export.csv_tum import CsvTable\nCsvTable.write = lambda *_: os.kill(os.getpid(), 9)"
    )
    write(tmp_path, "it", before=kill)
    outcome = run(tmp_path, "--record", "csv")["it"]
    assert (outcome.status, remarks(outcome)) == ("passed", ["the recordings were cut off: SIGKILL"])
    assert outcome.recordings == ()


REMOVES: Final = {
    "its scratch folder": f"{ONCE}shutil.rmtree(tempfile.gettempdir())",
    "its script": f"{ONCE}os.remove(__file__)",
    "its folder": "shutil.rmtree(os.path.dirname(__file__), ignore_errors=True)",
    "the output folder": "shutil.rmtree('out', ignore_errors=True)",
}


@on_linux
@pytest.mark.parametrize("what", soaked(REMOVES, short=["its folder", "the output folder"]))
def test_a_script_that_removes_files_is_judged(tmp_path: Path, what: str) -> None:
    (tmp_path / "deep").mkdir()
    write(tmp_path / "deep", "it", REMOVES[what])
    outcome = run(tmp_path, "--record", "csv")["it"]
    assert outcome.status == "passed"
    assert outcome.trace is not None
    assert (tmp_path / "out" / outcome.trace).is_file()


@pytest.mark.skipif(sys.platform == "win32", reason="os.getuid is missing")
def test_a_golden_file_that_cannot_be_written_is_an_error_with_its_name(tmp_path: Path) -> None:
    write(tmp_path, "it", f"{ONCE}pathlib.Path('golden').write_text('')")
    path, golden = tmp_path / "it.sim.yml", "{matches: {trace: golden/it.csv, position: 1 cm}}"
    path.write_text(path.read_text().replace("expect: [", f"expect: [{golden}, "))
    (failure,) = run(tmp_path, "--update-golden", code=2)["it"].failures
    assert "golden/it.csv cannot be written: " in failure.message
