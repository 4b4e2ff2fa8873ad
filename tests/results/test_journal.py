from __future__ import annotations

import errno
import json
import os
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest

from sim_action.core.errors import ExitCode, UsageError
from sim_action.results.journal import (
    JOURNAL_FILE,
    Finished,
    Header,
    Journal,
    JournalFollower,
    Planned,
    Progressed,
    RunEnded,
    Started,
    manifest,
    read_journal,
)
from sim_action.results.outcome import Failure, Outcome
from tests.outcomes import outcome as of_file

NAMES = ("a", "b", "c")
FAILED = Failure(kind="crash", title="SIGSEGV", message="it crashed")
INTERRUPTED = Failure(kind="interrupted", title="interrupted", message="it was interrupted")


def outcome(name: str, failure: Failure | None = None) -> Outcome:
    found = of_file("s.sim.yml").model_copy(update={"name": name})
    return found if failure is None else Outcome(name=name, file="s.sim.yml", status="error", failures=(failure,))


def header(names: tuple[str, ...] = NAMES, files: tuple[str, ...] = ()) -> Header:
    planned = tuple(Planned(name=name, file="s.sim.yml") for name in names)
    return Header(journal=1, sim_action="1", python="3", platform="p", files=files, planned=planned)


def unheard(message: str) -> None:
    raise AssertionError(message)


def begun(folder: Path, warn: Callable[[str], None] = unheard) -> Journal:
    return Journal(folder, header(), warn, time.monotonic())


def statuses(folder: Path) -> list[str]:
    return [each.status for each in read_journal(folder).results().outcomes]


def test_each_final_outcome_is_in_the_file_at_once(tmp_path: Path) -> None:
    journal = begun(tmp_path)
    journal(Started(1, 1, "b"))
    journal(Finished(1, outcome("b")))
    results = read_journal(tmp_path).results()
    assert [each.status for each in results.outcomes] == ["error", "passed", "error"]
    assert results.outcomes[1] == outcome("b")
    assert results.exit_code is ExitCode.INTERRUPTED
    # Results so far are those that are final.
    journal(Finished(0, outcome("a")))
    assert [final.name for final in read_journal(tmp_path).results_so_far().outcomes] == ["a", "b"]


def test_results_from_the_file_are_those_of_the_call(tmp_path: Path) -> None:
    journal = begun(tmp_path)
    for place, name in enumerate(NAMES):
        journal(Started(place, 1, name))
        journal(Progressed(place, 1, name, 1.0, 1.0))
        journal(RunEnded(place, 1, outcome(name)))
        journal(Finished(place, outcome(name, FAILED if name == "b" else None)))
    results = journal.close()
    assert [each.status for each in results.outcomes] == ["passed", "error", "passed"]
    assert read_journal(tmp_path).results() == results


def test_unfinished_scenarios(tmp_path: Path) -> None:
    # Scenarios without an outcome are not finished.
    journal = begun(tmp_path)
    journal(Started(0, 1, "a"))
    first, second, _ = read_journal(tmp_path).results().outcomes
    assert first.failures[0].title == "not finished"
    assert first.failures[0].message == "sim-action ended before this scenario ended"
    assert second.failures[0].message == "sim-action ended before this scenario started"
    # Runs that have ended are told if others are missing.
    journal = begun(tmp_path)
    journal(RunEnded(0, 1, outcome("a"), is_one_of_several=True))
    journal(RunEnded(0, 2, outcome("a", FAILED), is_one_of_several=True))
    (failure,) = read_journal(tmp_path).results().outcomes[0].failures
    assert failure.message.endswith("scenario ended; run 1 passed; run 2 ended in an error (SIGSEGV: it crashed)")
    # An interrupted scenario has no outcome in the file.
    journal = begun(tmp_path)
    journal(Finished(0, outcome("a", INTERRUPTED)))
    assert journal.close().outcomes[0].failures == (INTERRUPTED,)
    assert read_journal(tmp_path).finished == {}


def test_a_last_line_that_is_cut_off_is_left_out(tmp_path: Path) -> None:
    journal = begun(tmp_path)
    journal(Finished(0, outcome("a")))
    journal(Finished(1, outcome("b")))
    path = tmp_path / JOURNAL_FILE
    whole = path.read_bytes()
    start = whole.rindex(b"\n", 0, -1) + 1
    for end in range(start, len(whole) - 1):
        path.write_bytes(whole[:end])
        assert statuses(tmp_path) == ["passed", "error", "error"]


@pytest.mark.parametrize(
    "line",
    [
        b"\xff",
        b"[]",
        b"null",
        b'{"at":1,"event":"finished","place":0}',
        b'{"at":1,"event":"finished","outcome":{"name":"a","file":"s.sim.yml","status":"skipped"}}',
        b'{"at":1,"event":"finished","place":3,"outcome":{"name":"a","file":"s.sim.yml","status":"skipped"}}',
        b'{"at":1,"event":"finished","place":-1,"outcome":{"name":"a","file":"s.sim.yml","status":"skipped"}}',
        b'{"at":1,"event":"finished","place":0,"outcome":{"name":"other","file":"s.sim.yml","status":"skipped"}}',
        b'{"at":-1,"event":"ended"}',
        b"[" * 100_000,
    ],
)
def test_a_line_that_is_not_valid_counts_for_nothing(tmp_path: Path, line: bytes) -> None:
    journal = begun(tmp_path)
    journal(Finished(1, outcome("b")))
    with (tmp_path / JOURNAL_FILE).open("ab") as file:
        file.write(line + b"\n")
    journal(Finished(2, outcome("c")))
    assert statuses(tmp_path) == ["error", "passed", "passed"]


CONTRADICTIONS = {
    "a failed verdict": {"expectations": of_file("s.sim.yml", holds=False).expectations},
    "a failure": {"failures": (FAILED,)},
    "no expectation": {"expectations": ()},
    "no reason": {"status": "error"},
}


@pytest.mark.parametrize("changed", CONTRADICTIONS.values(), ids=CONTRADICTIONS)
def test_an_outcome_that_contradicts_itself_is_no_final_outcome(tmp_path: Path, changed: dict[str, object]) -> None:
    journal = begun(tmp_path)
    journal(Finished(0, outcome("a").model_copy(update=changed)))
    journal(Finished(1, outcome("b")))
    assert statuses(tmp_path) == ["error", "passed", "error"]
    assert read_journal(tmp_path).results().outcomes[0].failures[0].title == "not finished"


@pytest.mark.parametrize("text", ["", "\n", "{}\n", "[]\n", '{"journal":2}\n', "x" * 10_000])
def test_a_journal_without_a_header_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / JOURNAL_FILE).write_text(text)
    with pytest.raises(UsageError, match=r"results\.jsonl is not a valid journal: "):
        read_journal(tmp_path)
    assert manifest(tmp_path) == ()


def test_the_manifest_lists_the_files_of_the_call_and_no_journal_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"results\.jsonl is not a valid journal: no such file"):
        read_journal(tmp_path)
    assert manifest(tmp_path) == ()
    Journal(tmp_path, header(files=("results.json", "traces/a.npz")), unheard, 0.0)
    assert manifest(tmp_path) == ("results.json", "traces/a.npz")


def test_a_removed_folder_is_made_again_with_everything_known(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    journal = begun(folder)
    journal(Finished(0, outcome("a")))
    (folder / JOURNAL_FILE).unlink()
    folder.rmdir()
    journal(Finished(2, outcome("c")))
    assert statuses(folder) == ["passed", "error", "passed"]


def garbage_appended(folder: Path) -> None:
    with (folder / JOURNAL_FILE).open("ab") as file:
        file.write(b"\xff\x00 garbage")


def truncated(folder: Path) -> None:
    os.truncate(folder / JOURNAL_FILE, 20)


def replaced(folder: Path) -> None:
    (folder / JOURNAL_FILE).replace(folder / "other")
    (folder / JOURNAL_FILE).write_bytes((folder / "other").read_bytes())


def folder_renamed(folder: Path) -> None:
    folder.rename(folder.with_name("moved"))


@pytest.mark.parametrize("change", [garbage_appended, truncated, replaced, folder_renamed])
def test_a_file_that_user_code_changed_is_written_again(tmp_path: Path, change: Callable[[Path], None]) -> None:
    folder = tmp_path / "out"
    journal = begun(folder)
    journal(Finished(0, outcome("a")))
    change(folder)
    journal(Finished(1, outcome("b", FAILED)))
    journal(Finished(2, outcome("c")))
    assert statuses(folder) == ["passed", "error", "passed"]
    assert read_journal(folder).finished[1].outcome == outcome("b", FAILED)
    assert len((folder / JOURNAL_FILE).read_bytes().splitlines()) == 4


def test_a_file_without_changes_is_not_written_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = begun(tmp_path)
    monkeypatch.setattr("sim_action.results.journal.whole_file", unheard)
    for place, name in enumerate(NAMES):
        journal(Finished(place, outcome(name)))
    assert statuses(tmp_path) == ["passed"] * 3


def test_a_full_disk_is_reported_once_and_the_outcomes_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []
    journal = begun(tmp_path, told.append)
    real = os.write

    def full(descriptor: int, data: bytes) -> int:
        if len(data) < 100:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(descriptor, data[:50])

    with monkeypatch.context() as patched:
        patched.setattr(os, "write", full)
        patched.setattr("sim_action.results.journal.whole_file", lambda _: Path("/dev/full").open("wb"))  # noqa: SIM115 - its caller closes it
        for place, name in enumerate(NAMES):
            journal(Finished(place, outcome(name)))
    assert told == ["the journal results.jsonl cannot be written: no space left on device; verdicts are kept in memory"]
    assert {each.status for each in journal.close().outcomes} == {"passed"}
    # There was space again when the call ended.
    assert statuses(tmp_path) == ["passed"] * 3


def test_earlier_outcomes_are_marked_and_replaced(tmp_path: Path) -> None:
    # Outcomes of an earlier call are marked.
    journal = begun(tmp_path)
    journal(Finished(1, outcome("b")))
    earlier = read_journal(tmp_path).finished.values()
    again = Journal(tmp_path, header(), unheard, time.monotonic(), earlier)
    assert statuses(tmp_path) == ["error", "passed", "error"]
    again(Finished(0, outcome("a")))
    kept = read_journal(tmp_path).finished
    assert [kept[place].taken_over for place in (0, 1)] == [False, True]
    assert kept[1].at == 0.0
    # A new outcome replaces one of an earlier call.
    begun(tmp_path)(Finished(1, outcome("b", FAILED)))
    again = Journal(tmp_path, header(), unheard, time.monotonic(), read_journal(tmp_path).finished.values())
    again(Finished(1, outcome("b")))
    assert again.close() == read_journal(tmp_path).results()
    assert statuses(tmp_path) == ["error", "passed", "error"]


def test_a_record_is_one_line_of_json(tmp_path: Path) -> None:
    journal = begun(tmp_path)
    journal(Finished(0, outcome("a").model_copy(update={"output": "two\nlines\u2028three"})))
    first, second = (tmp_path / JOURNAL_FILE).read_bytes().splitlines()
    assert json.loads(first)["journal"] == 1
    assert json.loads(second)["outcome"]["output"] == "two\nlines\u2028three"


def kept_bytes(folder: Path, count: int) -> int:
    """The memory that a call keeps after `count` outcomes, which come as JSON like those of child processes."""
    names = tuple(f"drives[speed={number / 7}]" for number in range(count))
    texts = [outcome(name).model_dump_json() for name in names]
    folder.mkdir()
    journal = Journal(folder, header(names), unheard, time.monotonic())
    tracemalloc.start()
    try:
        for place, text in enumerate(texts):
            journal(Started(place, 1, names[place]))
            journal(Finished(place, Outcome.model_validate_json(text)))
        return tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()


def test_a_call_keeps_less_than_two_kilobytes_of_an_outcome(tmp_path: Path) -> None:
    # Without sharing it is 5 kB. The first call builds what all of them share.
    kept_bytes(tmp_path / "first", 5)
    few, many = kept_bytes(tmp_path / "few", 50), kept_bytes(tmp_path / "many", 100)
    assert (many - few) / 50 < 2_000


def finished(follower: JournalFollower) -> list[int]:
    follower.look()
    assert follower.recorded is not None
    return sorted(follower.recorded.finished)


def test_each_look_finds_what_is_new(tmp_path: Path) -> None:
    follower = JournalFollower(tmp_path)
    follower.look()
    assert (follower.recorded, follower.call, follower.problem) == (None, 0, "")
    journal = begun(tmp_path)
    assert finished(follower) == []
    journal(Started(1, 1, "b"))
    journal(Finished(1, outcome("b")))
    assert finished(follower) == [1]
    assert not follower.is_over
    journal(Finished(0, outcome("a")))
    journal.close()
    assert finished(follower) == [0, 1]
    assert follower.is_over
    assert follower.call == 1
    assert follower.recorded is not None
    assert follower.recorded.results() == read_journal(tmp_path).results()


def test_an_unfinished_line_is_read_once_it_is_finished(tmp_path: Path) -> None:
    journal = begun(tmp_path)
    journal(Finished(0, outcome("a")))
    path = tmp_path / JOURNAL_FILE
    whole = path.read_bytes()
    follower = JournalFollower(tmp_path)
    path.write_bytes(whole[:-20])
    assert finished(follower) == []
    with path.open("ab") as file:
        file.write(whole[-20:])
    assert finished(follower) == [0]


def test_journals_that_grow_and_are_replaced(tmp_path: Path) -> None:
    # The journal of another call is read from its beginning.
    follower = JournalFollower(tmp_path)
    begun(tmp_path)(Finished(0, outcome("a")))
    assert finished(follower) == [0]
    begun(tmp_path)(Finished(1, outcome("b")))
    assert finished(follower) == [1]
    assert follower.call == 2
    # A journal that is removed is forgotten.
    begun(tmp_path)
    follower = JournalFollower(tmp_path)
    follower.look()
    (tmp_path / JOURNAL_FILE).unlink()
    follower.look()
    assert follower.recorded is None
    assert follower.problem == ""


def test_another_call_with_the_same_inode_is_noticed(tmp_path: Path) -> None:
    """The file keeps its inode, and is as long: only its content differs."""
    path = tmp_path / JOURNAL_FILE
    begun(tmp_path)(Finished(0, outcome("a")))
    follower = JournalFollower(tmp_path)
    assert finished(follower) == [0]
    other = path.read_bytes().replace(b'"place":0', b'"place":2')
    other = other.replace(b'"name":"a","file":"s.sim.yml","status', b'"name":"c","file":"s.sim.yml","status')
    with path.open("r+b") as file:
        file.write(other)
    assert finished(follower) == [2]


@pytest.mark.parametrize("line", [b"{}\n", b"[" * 100_000 + b"\n", b"\xff\xfe\n", b'{"journal": 2}\n'])
def test_a_file_that_is_no_journal_is_told(tmp_path: Path, line: bytes) -> None:
    (tmp_path / JOURNAL_FILE).write_bytes(line)
    follower = JournalFollower(tmp_path)
    follower.look()
    assert follower.recorded is None
    assert follower.problem.startswith(f"{JOURNAL_FILE} is not a valid journal: ")
    assert "\n" not in follower.problem


def test_hostile_lines_are_left_out(tmp_path: Path) -> None:
    begun(tmp_path)(Finished(0, outcome("a")))
    with (tmp_path / JOURNAL_FILE).open("ab") as file:
        file.write(b'{"at": 1e999, "event": "ended"}\n{"at": 0, "event": "started", "place": 99}\nnull\n\xff\n')
    follower = JournalFollower(tmp_path)
    assert finished(follower) == [0]
    assert not follower.is_over


@pytest.mark.skipif(not hasattr(os, "O_NOFOLLOW"), reason="links need rights there")
def test_a_link_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    begun(tmp_path / "other")
    (tmp_path / JOURNAL_FILE).symlink_to(tmp_path / "other" / JOURNAL_FILE)
    follower = JournalFollower(tmp_path)
    follower.look()
    assert follower.recorded is None
    assert "cannot be read" in follower.problem


def test_a_large_journal_is_read_in_several_looks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = begun(tmp_path)
    for place, name in enumerate("abc"):
        journal(Finished(place, outcome(name)))
    monkeypatch.setattr("sim_action.results.journal._MAX_BYTES_OF_LOOK", 300)
    follower = JournalFollower(tmp_path)
    looks = 0
    while not looks or follower.has_more:
        follower.look()
        looks += 1
    assert looks > 2
    assert finished(follower) == [0, 1, 2]
