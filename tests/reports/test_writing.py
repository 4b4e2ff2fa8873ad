"""A report that cannot be written loses neither the other reports nor a verdict."""

from __future__ import annotations

import errno
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import junitparser
import pytest

from sim_action.core.errors import ExitCode
from sim_action.core.wording import log_line
from sim_action.reports import ReportOptions, Verbosity
from sim_action.reports.display import STATUS_DISPLAYS
from sim_action.reports.escaping import one_line
from sim_action.reports.writing import REPORTS, make_ready, write_reports
from sim_action.results.output_folder import Room
from sim_action.results.results_json import Results
from tests.outcomes import like
from tests.reports.samples import SAMPLES

FULL = "/dev/full"
NO_SPACE = "no space left on device"
pytestmark = pytest.mark.skipif(not Path(FULL).exists(), reason="there is no /dev/full")
PASSED_LINE = "passed  burger drives straight"
FAILED_LINE = "failed  burger stops before the wall  no_collision: base_link touched wall"


Capture = pytest.CaptureFixture[str]
FILES = {"results.json", "junit.xml", "report.html"}


@pytest.fixture
def opened(options: ReportOptions) -> ReportOptions:
    options.folder.mkdir(parents=True, exist_ok=True)
    return options


def without_passed(options: ReportOptions, capture: Capture) -> str:
    """The messages about passed results of which a required file cannot be written, with the verdict beside them."""
    assert write_reports(SAMPLES["passed"], options) is ExitCode.FAILED
    shown = capture.readouterr()
    assert PASSED_LINE in shown.out.splitlines()
    return shown.err


@contextmanager
def limited_files() -> Iterator[None]:
    """Limit files to 100 bytes, as a disk that gets full does. The output of pytest may be a file, too."""
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def written(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_exit_codes_and_files_of_reports(opened: ReportOptions) -> None:
    # The exit code is that of the results if all is written.
    assert write_reports(SAMPLES["passed"], opened) is ExitCode.PASSED
    assert write_reports(SAMPLES["failed"], opened) is ExitCode.FAILED
    assert written(opened.folder) == FILES
    # A higher code of the results wins.
    for results in SAMPLES.values():
        code = write_reports(results, replace(opened, environment={"GITHUB_OUTPUT": FULL}))
        assert code is max(results.exit_code, ExitCode.FAILED)


def test_a_summary_that_cannot_be_written_is_a_warning(opened: ReportOptions, capsys: Capture) -> None:
    environment = {"GITHUB_STEP_SUMMARY": FULL}
    assert write_reports(SAMPLES["passed"], replace(opened, environment=environment)) is ExitCode.PASSED
    shown = capsys.readouterr()
    assert shown.err == f"sim-action: warning: the summary cannot be written to {FULL}: {NO_SPACE}\n"
    assert PASSED_LINE not in shown.out
    assert written(opened.folder) == FILES


def test_a_report_that_cannot_be_written_is_a_warning_and_named_nowhere(
    opened: ReportOptions, tmp_path: Path, capsys: Capture
) -> None:
    (opened.folder / "report.html").mkdir()
    environment = {"GITHUB_OUTPUT": str(tmp_path / "outputs")}
    assert write_reports(SAMPLES["passed"], replace(opened, environment=environment)) is ExitCode.PASSED
    shown = capsys.readouterr()
    report = opened.folder / "report.html"
    assert shown.err == f"sim-action: warning: the HTML report cannot be written to {report}: is a directory\n"
    assert "report.html" not in shown.out
    assert "report.html" not in (tmp_path / "outputs").read_text()


@pytest.mark.parametrize("verbosity", ["quiet", "normal"])
@pytest.mark.parametrize("name", ["results.json", "junit.xml"])
def test_without_a_required_file_each_verdict_is_on_standard_output(
    name: str, verbosity: Verbosity, opened: ReportOptions, capsys: Capture
) -> None:
    (opened.folder / name).mkdir()
    asked = replace(opened, verbosity=verbosity)
    messages = without_passed(asked, capsys)
    assert f"cannot be written to {opened.folder / name}: is a directory" in messages
    assert "warning" not in messages
    assert written(opened.folder) == FILES
    assert write_reports(SAMPLES["failed"], asked) is ExitCode.FAILED
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith(FAILED_LINE) for line in lines)


def test_each_outcome_has_one_line_with_its_first_reason(opened: ReportOptions, capsys: Capture) -> None:
    asked = replace(opened, environment={"GITHUB_OUTPUT": FULL}, silenced=frozenset(REPORTS) - {"outputs"})
    for results in SAMPLES.values():
        write_reports(results, asked)
        lines = capsys.readouterr().out.splitlines()
        assert len(lines) == max(results.total, 1)
        for line, outcome in zip(lines, results.outcomes, strict=False):
            reasons = [each.message for each in outcome.failures] + [each.verdict.message for each in outcome.causes]
            assert log_line(one_line(next(iter(reasons), ""))) in line
            assert line.startswith(STATUS_DISPLAYS[outcome.status].word)
    # They are no workflow commands.
    nasty = like(SAMPLES["passed"].outcomes[0], name="a\n::error::b ##[error]c")
    write_reports(like(SAMPLES["passed"], outcomes=(nasty,)), asked)
    assert capsys.readouterr().out == "passed  a ::error::b # #[error]c\n"


def test_a_disk_that_gets_full_leaves_no_parts_of_files(opened: ReportOptions, tmp_path: Path, capsys: Capture) -> None:
    environment = {name: str(tmp_path / name) for name in ("GITHUB_OUTPUT", "GITHUB_STEP_SUMMARY")}
    with limited_files():
        messages = without_passed(replace(opened, environment=environment), capsys)
    assert messages.count("file too large") == 5
    assert messages.count("warning") == 2
    assert written(opened.folder) == set()
    assert [Path(name).read_bytes() for name in environment.values()] == [b"", b""]


def test_a_folder_that_may_not_be_written_to_is_a_reason(opened: ReportOptions, capsys: Capture) -> None:
    make_ready(opened)
    opened.folder.chmod(0o500)
    user = os.geteuid()
    if user == 0:
        # Root may write anywhere.
        os.seteuid(65534)
    try:
        messages = without_passed(opened, capsys)
    finally:
        os.seteuid(user)
        opened.folder.chmod(0o700)
    assert messages.count("permission denied") == 3


def test_without_free_descriptors_each_verdict_is_on_standard_output(opened: ReportOptions, capfd: Capture) -> None:
    make_ready(opened)
    write_reports(SAMPLES["passed"], opened)
    capfd.readouterr()
    taken = []
    import resource

    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (200, before[1]))
    try:
        while True:
            taken.append(os.open(os.devnull, os.O_RDONLY))
    except OSError:
        code = write_reports(SAMPLES["passed"], opened)
    finally:
        for descriptor in taken:
            os.close(descriptor)
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
    assert code is ExitCode.FAILED
    shown = capfd.readouterr()
    assert PASSED_LINE in shown.out.splitlines()
    assert "too many open files" in shown.err


def test_on_github_a_missing_report_is_an_annotation_or_a_line_if_that_cannot_be_imported(
    opened: ReportOptions, capsys: Capture
) -> None:
    options = replace(opened, environment={"GITHUB_OUTPUT": FULL, "GITHUB_ACTIONS": "true"})
    message = f"the outputs cannot be written to {FULL}: {NO_SPACE}"
    assert f"::error title=sim-action::{message}" in without_passed(options, capsys)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "sim_action.reports.github.annotations", None)
        silenced = replace(options, silenced=opened.silenced | {"annotations"})
        assert f"sim-action: {message}" in without_passed(silenced, capsys)


def test_an_output_folder_that_vanished_is_made_again(opened: ReportOptions, capsys: Capture) -> None:
    opened.folder.rmdir()
    assert write_reports(SAMPLES["passed"], opened) is ExitCode.PASSED
    assert written(opened.folder) == {*FILES, ".gitignore"}
    # A file in its place is a reason.
    shutil.rmtree(opened.folder)
    opened.folder.touch()
    capsys.readouterr()
    assert "not a directory" in without_passed(opened, capsys)


@pytest.mark.parametrize("name", ["report", "junit", "terminal"])
def test_a_fault_of_one_report_loses_no_other(
    name: str, opened: ReportOptions, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    load, empty = type(REPORTS).load, dict[str, object]()

    def faulty(table: object, wanted: str) -> object:
        return empty[wanted] if wanted == name else load(REPORTS, wanted)

    monkeypatch.setattr(type(REPORTS), "load", faulty)
    assert write_reports(SAMPLES["passed"], opened) is ExitCode.INTERNAL
    shown = capsys.readouterr()
    assert f"an internal error of sim-action: KeyError: '{name}'; please report it" in shown.err
    assert (PASSED_LINE in shown.out.splitlines()) == (name == "junit")
    files = {"report": "report.html", "junit": "junit.xml"}
    assert written(opened.folder) == FILES - {files.get(name)}


def test_a_lack_of_memory_is_a_reason_and_no_fault(
    opened: ReportOptions, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    def exhausted(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr(Results, "write", exhausted)
    assert write_reports(SAMPLES["passed"], opened) is ExitCode.FAILED
    assert capsys.readouterr().err.endswith("results.json: out of memory\n")


def test_the_junit_comes_before_the_large_report() -> None:
    names = list(REPORTS)
    assert names.index("junit") < names.index("report") < names.index("outputs") < names.index("terminal")


def test_text_that_the_file_system_cannot_name_is_a_reason(opened: ReportOptions, capsys: Capture) -> None:
    asked = replace(opened, junit=opened.folder / "\ud800.xml")
    assert "surrogates not allowed" in without_passed(asked, capsys)


def test_a_full_disk_behind_standard_output_is_a_warning(
    opened: ReportOptions, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    full = os.fdopen(os.open(FULL, os.O_WRONLY), "w")
    with monkeypatch.context() as patched:
        patched.setattr(sys, "stdout", full)
        assert write_reports(SAMPLES["passed"], opened) is ExitCode.PASSED
        assert NO_SPACE in capsys.readouterr().err
        (opened.folder / "junit.xml").unlink()
        (opened.folder / "junit.xml").mkdir()
        assert write_reports(SAMPLES["passed"], opened) is ExitCode.FAILED
    assert PASSED_LINE in capsys.readouterr().err.splitlines()
    with pytest.raises(OSError, match="No space"):
        full.close()


def test_the_junit_is_whole_if_another_report_is_missing(opened: ReportOptions) -> None:
    (opened.folder / "report.html").mkdir()
    write_reports(SAMPLES["failed"], opened)
    assert junitparser.JUnitXml.fromfile(str(opened.junit)).failures


def test_no_report_names_a_file_that_was_removed(opened: ReportOptions, capsys: Capture) -> None:
    named = {"trace": "traces/a.npz", "replay": "replays/a.json.gz", "recordings": ("recordings/a.csv",)}
    outcome = like(SAMPLES["passed"].outcomes[0], **named)
    results = like(SAMPLES["passed"], outcomes=(outcome,))
    (opened.folder / "recordings").mkdir()
    (opened.folder / "recordings/a.csv").touch()
    assert write_reports(results, opened) is ExitCode.PASSED
    [stored] = Results.read(opened.folder / "results.json").outcomes
    assert (stored.trace, stored.replay, stored.recordings) == (None, None, ("recordings/a.csv",))
    assert stored.notes[-2:] == ("trace: it was removed after the run", "replay: it was removed after the run")
    assert "a.npz" not in opened.junit.read_text() + capsys.readouterr().out


@pytest.mark.parametrize(("free", "left"), [(0, {"b.npz"}), (10**9, {"a.npz", "b.npz"})])
def test_files_of_runs_make_room_for_the_verdicts_the_largest_first(
    free: int, left: set[str], opened: ReportOptions, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    """The disk is full until one of them is removed. Where it has room, that would not help."""
    traces, plain = opened.folder / "traces", SAMPLES["passed"].outcomes[0]
    traces.mkdir()
    for name, size in (("a.npz", 200), ("b.npz", 100)):
        (traces / name).write_bytes(bytes(size))
    alone = like(plain, replay=None, recordings=())
    outcomes = tuple(like(alone, name=name, trace=f"traces/{name}.npz") for name in "ab")
    whole = Results.write

    def write(results: Results, folder: Path) -> Path:
        if len(list(traces.iterdir())) > 1:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return whole(results, folder)

    monkeypatch.setattr(Results, "write", write)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(free, 0, free))
    code = write_reports(like(SAMPLES["passed"], outcomes=outcomes), replace(opened, room=Room(opened.folder)))
    assert {path.name for path in traces.iterdir()} == left
    assert code is (ExitCode.FAILED if free else ExitCode.PASSED)
    if not free:
        assert f"{NO_SPACE}: traces/a.npz was removed" in capsys.readouterr().err
        stored = Results.read(opened.folder / "results.json").outcomes
        assert [made.trace for made in stored] == [None, "traces/b.npz"]
        assert stored[0].notes[-1] == f"trace: it was removed to make room: {NO_SPACE}"
