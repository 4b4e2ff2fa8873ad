"""One call at a time uses an output folder, and removes no file but its own."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import ExitCode, UsageError
from sim_action.reports.writing import write_reports
from sim_action.results.journal import Finished, Header, Journal, Planned, read_journal
from sim_action.results.output_folder import (
    LOCK_FILE,
    create_folder,
    is_comparison,
    is_foreign,
    is_own_junit,
    locked,
    refuse_foreign_files,
    remove_earlier_files,
    remove_unfinished_files,
    write_zeros,
)
from sim_action.results.results_json import Results
from tests.outcomes import outcome, report_options

# It holds the lock until its standard input ends, and says first whether it has it.
HOLDER = """
import sys
from pathlib import Path
from sim_action.core.errors import UsageError
from sim_action.results.output_folder import create_folder, locked
sys.stdin.readline()
try:
    create_folder(Path(sys.argv[1]))
    with locked(Path(sys.argv[1])):
        print("locked", flush=True)
        sys.stdin.read()
except UsageError as error:
    print(error, flush=True)
"""


def started(folder: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", HOLDER, str(folder)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdin is not None
    return process


def begin(process: subprocess.Popen[str]) -> None:
    assert process.stdin is not None
    process.stdin.write("go\n")
    process.stdin.flush()


def answer(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def first_answer(folder: Path) -> str:
    """What another process says that wants the folder, and then ends."""
    process = started(folder)
    begin(process)
    said = answer(process)
    process.communicate()
    return said


@pytest.fixture
def holder(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    process = started(tmp_path / "out")
    begin(process)
    assert answer(process) == "locked"
    yield process
    process.communicate()


@pytest.mark.process
def test_the_second_call_names_the_first_and_touches_nothing(tmp_path: Path, holder: subprocess.Popen[str]) -> None:
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").iterdir()}
    with (
        pytest.raises(UsageError, match=rf"out is in use by another run of sim-action \(process {holder.pid}\); wait"),
        locked(tmp_path / "out"),
    ):
        pass
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "out").iterdir()} == before
    assert (tmp_path / "out" / LOCK_FILE).read_text() == f"{holder.pid}\n"
    holder.communicate()
    with locked(tmp_path / "out"):
        assert (tmp_path / "out" / LOCK_FILE).read_text() == f"{os.getpid()}\n"
    assert [path.name for path in (tmp_path / "out").iterdir()] == [".gitignore"]


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_a_call_that_was_killed_leaves_no_stale_lock(tmp_path: Path, holder: subprocess.Popen[str]) -> None:
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    assert (tmp_path / "out" / LOCK_FILE).exists()
    with locked(tmp_path / "out"):
        pass


@pytest.mark.process
def test_of_many_calls_that_start_at_once_exactly_one_has_the_folder(tmp_path: Path) -> None:
    several = [started(tmp_path / "out") for _ in range(4)]
    for process in several:
        begin(process)
    answers = [answer(process) for process in several]
    for process in several:
        process.communicate()
    [winner] = [process for process, said in zip(several, answers, strict=True) if said == "locked"]
    others = [said for said in answers if said != "locked"]
    assert all(f"(process {winner.pid})" in said for said in others)
    assert len(others) == 3


@pytest.mark.process
@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
def test_a_forked_child_neither_holds_nor_releases_the_lock(tmp_path: Path) -> None:
    with locked(tmp_path):
        ready, release = os.pipe(), os.pipe()
        child = os.fork()
        if child == 0:
            try:
                os.closerange(3, ready[1])
                os.write(ready[1], b"x")
                os.read(release[0], 1)
            finally:
                os._exit(0)
        os.read(ready[0], 1)
        assert f"(process {os.getpid()})" in first_answer(tmp_path)
    assert first_answer(tmp_path) == "locked"
    os.write(release[1], b"x")
    os.waitpid(child, 0)
    for descriptor in (*ready, *release):
        os.close(descriptor)


def test_the_lock_of_a_folder(tmp_path: Path) -> None:
    # The same process locks a folder once.
    with locked(tmp_path):
        used = pytest.raises(UsageError, match=rf"in use by another run of sim-action \(process {os.getpid()}\)")
        with used, locked(tmp_path / "."):
            pass
        assert (tmp_path / LOCK_FILE).exists()
    with locked(tmp_path):
        pass
    # The lock is released after an error.
    with pytest.raises(ZeroDivisionError), locked(tmp_path):
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []
    # A folder that is removed meanwhile harms nothing.
    folder = tmp_path / "out"
    create_folder(folder)
    with locked(folder):
        shutil.rmtree(folder)
    assert not folder.exists()
    # A lock file of another call stays.
    with locked(tmp_path):
        (tmp_path / LOCK_FILE).unlink()
        (tmp_path / LOCK_FILE).write_text("another\n")
    assert (tmp_path / LOCK_FILE).read_text() == "another\n"


def test_a_lock_file_that_is_no_file_is_not_written_to(tmp_path: Path) -> None:
    (tmp_path / "target").write_text("mine")
    lock = tmp_path / LOCK_FILE
    lock.symlink_to("target")
    with pytest.raises(UsageError, match=r"\.sim-action\.lock' is a link"), locked(tmp_path):
        pass
    assert (tmp_path / "target").read_text() == "mine"
    lock.unlink()
    os.mkfifo(lock)
    with pytest.raises(UsageError, match="not a regular file"), locked(tmp_path):
        pass
    lock.unlink()
    (tmp_path / "of the user").write_text("kept")
    lock.hardlink_to(tmp_path / "of the user")
    with pytest.raises(UsageError, match="not a regular file of its own"), locked(tmp_path):
        pass
    assert (tmp_path / "of the user").read_text() == "kept"
    lock.unlink()
    lock.mkdir()
    with pytest.raises(UsageError, match="cannot write to the output folder"), locked(tmp_path):
        pass


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.ENOLCK])
def test_a_call_goes_on_without_a_lock_where_there_can_be_none(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: object) -> int:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "open", refuse)
    with locked(tmp_path):
        pass
    reason = os.strerror(number)
    assert capsys.readouterr().err == (
        f"sim-action: warning: the output folder {tmp_path} is not locked against other runs: "
        f"{reason[0].lower()}{reason[1:]}\n"
    )


def test_a_folder_without_permission_is_an_error_of_the_call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> int:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(UsageError, match=r"cannot write to the output folder .*: permission denied"), locked(tmp_path):
        pass


@contextmanager
def mounted(place: Path, options: str) -> Iterator[Path]:
    """Mount a small file system, and yield a new output folder in it."""
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(place)]
    if subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("no file system can be mounted here")
    try:
        create_folder(place / "out")
        yield place / "out"
    finally:
        subprocess.run(["umount", "--lazy", str(place)], check=True)


mounts = pytest.mark.skipif(sys.platform != "linux" or os.geteuid() != 0, reason="only root mounts a file system")


@pytest.mark.process
@mounts
def test_a_full_file_system_is_a_warning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with mounted(tmp_path / "small", "size=64k,nr_inodes=4") as folder:
        with suppress(OSError):
            for number in range(9):
                (folder.parent / str(number)).touch()
        with locked(folder):
            pass
    assert "is not locked against other runs: no space left on device" in capsys.readouterr().err


def fill_disk(path: Path) -> int:
    """Write to a file until the disk is full, and return its size."""
    path.parent.mkdir(exist_ok=True)
    with suppress(OSError), path.open("wb", buffering=0) as file:
        while True:
            file.write(bytes(4096))
    return path.stat().st_size


@pytest.mark.process
@mounts
@pytest.mark.parametrize("has_call", [True, False])
def test_files_of_runs_leave_the_space_of_the_verdicts(
    has_call: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The journal and the reports fit on a disk that a trace and a file of the user have filled."""
    if not has_call:
        # As on other systems, which write zeros.
        monkeypatch.setattr(os, "posix_fallocate", lambda descriptor, _, size: write_zeros(descriptor, size))
    ended = [outcome(f"{number}.sim.yml") for number in range(20)]
    header = Header.of_call(map(Planned.of, ended), ["traces/a.npz"])
    with mounted(tmp_path / "small", "size=1500k") as folder, locked(folder) as room:
        room.reserve(len(ended))
        assert fill_disk(folder / "traces/a.npz") > 800_000
        journal = Journal(folder, header, print, 0.0, make_room=room.make)
        for place, each in enumerate(ended):
            journal(Finished(place, each))
        fill_disk(folder.parent / "of the user")
        results = journal.close()
        assert write_reports(results, replace(report_options(folder), room=room)) is ExitCode.PASSED
        assert read_journal(folder).results() == results
        assert (folder / "traces/a.npz").exists()
        assert Results.read(folder / "results.json").total == len(ended)
        assert (folder / "junit.xml").stat().st_size > 0
    assert "removed" not in capsys.readouterr().err


@pytest.mark.process
@mounts
@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT])
def test_a_disk_without_a_reserve_loses_the_largest_files_of_runs(
    number: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sizes = {"traces/a.npz": 20_000, "replays/b.json.gz": 40_000, "recordings/c.mcap": 60_000, "own.bin": 80_000}
    error = OSError(number, os.strerror(number))
    with mounted(tmp_path / "small", "size=300k") as folder, locked(folder) as room:
        for name, size in sizes.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_bytes(bytes(size))
        room.reserve(20)
        while room.make(error, [*sizes, "traces/../own.bin", "../own.bin", "traces/none.npz"]):
            pass
        assert [name for name in sizes if (folder / name).exists()] == ["own.bin"]
        assert not room.make(OSError(errno.EIO, "EIO"), sizes)
    lines = capsys.readouterr().err.splitlines()
    assert "may lack space for results: 0.5 MB are needed" in lines[0]
    assert [line.split(": ")[3].split(" ")[0] for line in lines[1:]] == [*reversed(sizes)][1:]


@pytest.mark.process
def test_the_process_of_a_lock_with_a_reserve_is_named(tmp_path: Path) -> None:
    with locked(tmp_path) as room:
        room.reserve(10)
        assert (tmp_path / LOCK_FILE).stat().st_size > 240_000
        assert f"(process {os.getpid()})" in first_answer(tmp_path)
        room.release()
        assert (tmp_path / LOCK_FILE).read_text() == f"{os.getpid()}\n"
    assert not (tmp_path / LOCK_FILE).exists()


OURS = (
    *("results.json", "junit.xml", "report.html"),
    *("traces/a.npz", "replays/a.json.gz", "recordings/a.mcap", "recordings/a-2.tum"),
)
STRANGE = (
    *("", ".", "..", "a.sim.yml", "results.json/", "./results.json", "../results.json", "traces", "traces/"),
    *("traces/.npz", "traces/a.yml", "traces/../a.npz", "traces/deep/a.npz", "traces\\a.npz", "traces//a.npz"),
    *("replays/a.npz", "recordings/a.py", "other/a.npz", "/etc/passwd", "traces/a\0.npz", ".gitignore"),
    *("traces/" + "x" * 300 + ".npz", "x" * 5000),
)


def filled(folder: Path) -> set[Path]:
    for name in (*OURS, "a.sim.yml", "a.npz", "traces/a.yml", "traces/deep/a.npz", "replays/a.npz", "other/a.npz"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(name)
    return files(folder)


def files(folder: Path) -> set[Path]:
    return {path for path in folder.rglob("*") if path.is_file()}


def test_the_files_of_the_earlier_call_are_removed_and_no_others(tmp_path: Path) -> None:
    before = filled(tmp_path / "out")
    (tmp_path / "a.npz").touch()
    (tmp_path / "results.json").touch()
    remove_earlier_files(tmp_path / "out", STRANGE)
    assert files(tmp_path / "out") == before
    remove_earlier_files(tmp_path / "out", [str(tmp_path / "results.json"), "../a.npz"])
    assert {path.name for path in tmp_path.iterdir()} == {"out", "a.npz", "results.json"}
    remove_earlier_files(tmp_path / "out", (*STRANGE, *OURS, "traces/missing.npz"))
    assert files(tmp_path / "out") == before - {tmp_path / "out" / name for name in OURS}


@given(st.lists(st.text(alphabet="tracesjunit.xmlnpz/\\.\0 ") | st.text() | st.sampled_from(STRANGE)))
def test_no_text_removes_a_file_that_is_not_named_like_ours(names: list[str]) -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        before = filled(Path(folder) / "out")
        remove_earlier_files(Path(folder) / "out", names)
        removed = {path.relative_to(Path(folder) / "out").as_posix() for path in before - files(Path(folder))}
        assert removed <= set(OURS) & set(names)


def test_nothing_is_removed_through_a_link(tmp_path: Path) -> None:
    elsewhere, out = tmp_path / "elsewhere", tmp_path / "out"
    elsewhere.mkdir()
    out.mkdir()
    (elsewhere / "a.npz").touch()
    (elsewhere / "junit.xml").touch()
    (out / "traces").symlink_to(elsewhere)
    (out / "junit.xml").symlink_to(elsewhere / "junit.xml")
    (out / "results.json").mkdir()
    os.mkfifo(out / "report.html")
    remove_earlier_files(out, ["traces/a.npz", "junit.xml", "results.json", "report.html"])
    assert {path.name for path in elsewhere.iterdir()} == {"a.npz", "junit.xml"}
    assert {path.name for path in out.iterdir()} == {"traces", "junit.xml", "results.json", "report.html"}


def test_only_a_new_folder_ignores_itself(tmp_path: Path) -> None:
    create_folder(tmp_path / "a/b")
    create_folder(tmp_path / "a")
    create_folder(tmp_path)
    assert files(tmp_path) == {tmp_path / "a/b/.gitignore"}
    (tmp_path / "a/b/.gitignore").write_text("mine")
    create_folder(tmp_path / "a/b")
    assert (tmp_path / "a/b/.gitignore").read_text() == "mine"


def test_a_file_in_place_of_the_folder_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for path in ("file", "file/below"):
        with pytest.raises(OSError, match=r"File exists|Not a directory"):
            create_folder(tmp_path / path)


def test_unfinished_files_of_a_killed_call_are_removed(tmp_path: Path) -> None:
    unfinished = (".0123456789abcdef.json", "traces/.0123456789abcdef.npz", "recordings/.fedcba9876543210")
    for name in (*unfinished, *(others := (".0123456789abcde.npz", "traces/.x.npz", "other/.0123456789abcdef.npz"))):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "replays").symlink_to(tmp_path / "other")
    (tmp_path / ".aaaaaaaaaaaaaaaa.json").symlink_to("other")
    remove_unfinished_files(tmp_path)
    assert files(tmp_path) == {tmp_path / name for name in others}
    assert (tmp_path / ".aaaaaaaaaaaaaaaa.json").is_symlink()


GOLDEN = Path(__file__).parents[1] / "reports/golden"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<testsuites name='sim-action'/>", True),
        ("<?xml version='1.0'?>\n<!-- merged -->\n<testsuites tests='1' name='sim-action'>", True),
        ("<testsuites name='sim-action'><broken", True),
        ("<testsuites/>", False),
        ('<testsuite name="sim-action"><testcase', False),
        ("<?xml version='1.0'?>\n<!-- sim-action -->\n<testsuites name='pytest tests'>", False),
        ("<testsuites><testsuite name='sim-action'>", False),
        ("<robot name='sim-action'><testsuites name='sim-action'/></robot>", False),
        ("<!-- <testsuites> --><robot/>", False),
        ("<?xml version='1.0' encoding='nothing'?><testsuites/>", False),
        ("name: a\nexpect: []\n", False),
        ("\0\1\2", False),
        (" ", False),
    ],
)
def test_the_root_and_its_name_make_a_file_our_junit_xml(text: str, expected: bool) -> None:
    assert is_own_junit(text.encode()) is expected


@given(st.binary(max_size=300))
def test_any_bytes_are_recognised_or_not(data: bytes) -> None:
    assert is_own_junit(data) in (True, False)
    assert is_comparison(data) in (True, False)


def test_reports_of_every_kind_are_recognised() -> None:
    for path in GOLDEN.glob("*.xml"):
        assert not is_foreign(path, is_own_junit)
    assert not is_foreign(GOLDEN / "comparison.md", is_comparison)
    assert is_foreign(GOLDEN / "passed.md", is_comparison)
    assert not is_foreign(GOLDEN / "missing", is_comparison)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("results.json", '{"name": "my results"}'),
        ("results.json", "[]"),
        ("results.jsonl", '{"event": 1}\n'),
        ("report.html", "<!doctype html><p>My report"),
        ("junit.xml", "<robot/>"),
        ("traces/a.npz", "x"),
        ("replays/a.json.gz", "x"),
        ("recordings/a.csv", "time,x\n"),
    ],
)
def test_a_file_of_the_user_in_the_output_folder_is_kept(name: str, text: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UsageError, match=f"has a file '{name}' that sim-action did not write.*choose another folder"):
        refuse_foreign_files(tmp_path)
    path.write_bytes(b"")
    if path.parent == tmp_path:
        refuse_foreign_files(tmp_path)


@pytest.mark.parametrize("name", ["results.json", "results.jsonl", "report.html", "junit.xml"])
@pytest.mark.parametrize("target", ["outside", "missing"])
def test_no_file_is_read_through_a_link(
    name: str, target: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "results").mkdir()
    (tmp_path / "outside").write_text("secret")
    (tmp_path / "results" / name).symlink_to(tmp_path / target)
    opened: list[object] = []
    real = os.open

    def open_(path: str, flags: int, *more: int) -> int:
        descriptor = real(path, flags, *more)
        opened.append(path)
        return descriptor

    monkeypatch.setattr(os, "open", open_)
    with pytest.raises(UsageError, match=f"'.*/results/{name}' is a link, .* not written through links; remove it"):
        refuse_foreign_files(tmp_path / "results")
    assert not opened


def test_folders_with_files_of_the_user_and_missing_ones(tmp_path: Path) -> None:
    # Other files and folders of the user do not matter.
    for name in ("robot.urdf", "traces/notes.txt", "recordings/ride.bag", "a.sim.yml", "tests.xml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("x")
    refuse_foreign_files(tmp_path)
    # A missing folder has no files.
    refuse_foreign_files(tmp_path / "missing")
    (tmp_path / "file").touch()
    refuse_foreign_files(tmp_path / "file")
