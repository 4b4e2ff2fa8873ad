"""Names for traces, and which file a name in results that may be a stranger's stands for."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.results import artifacts
from sim_action.results.outcome import Outcome, Repeats
from tests.work import work_of


def test_a_name_becomes_a_plain_file_name() -> None:
    (path,) = artifacts.trace_paths(["burger: 1.5 m / 30 s"], Path("out"))
    assert path == Path("out/traces/burger-1.5-m-30-s.npz")


@given(st.lists(st.text(max_size=200), max_size=10))
def test_paths_stay_in_the_folder_and_differ_whatever_the_case(names: list[str]) -> None:
    paths = artifacts.trace_paths(names, Path("out"))
    assert all(path.parent == Path("out/traces") and path.suffix == ".npz" for path in paths)
    assert len({str(path).lower() for path in paths}) == len(names)
    assert all(len(path.name.encode()) < 120 for path in paths)


def test_numbers_of_equal_names() -> None:
    # Of equal names each has the first number that is free.
    names = ["a", "A", "a-2", "b", "a-4", "a", "a", "a-2"]
    assert [path.stem for path in artifacts.trace_paths(names, Path())] == [
        *("a", "A-2", "a-2-2", "b", "a-4", "a-3", "a-5", "a-2-3")
    ]
    # Of equal names each is told by its number.
    names = ["a", "A", "a-2", "b", "a-4", "a", "a", "a-2"]
    stored = [artifacts.replay_path(path).as_posix() for path in artifacts.trace_paths(names, Path())]
    numbers = [artifacts.namesake_number(name, path) for name, path in zip(names, stored, strict=True)]
    assert list(zip(names, numbers, strict=True)) == [
        *(("a", 1), ("A", 2), ("a-2", 2), ("b", 1), ("a-4", 1), ("a", 3), ("a", 5), ("a-2", 3))
    ]


@pytest.mark.parametrize("stored", ["", "replays/", "replays/b-2.json.gz", "replays/a-x.json.gz", f"a-{9**99}.json.gz"])
def test_what_tells_no_number_is_the_first(stored: str) -> None:
    assert artifacts.namesake_number("a", stored) == 1


def test_very_many_equal_names_take_no_longer_than_others() -> None:
    def work(count: int) -> int:
        return work_of(lambda: artifacts.trace_paths(["same"] * count, Path()))

    assert len({path.stem for path in artifacts.trace_paths(["same"] * 2_000, Path())}) == 2_000
    assert work(400) - work(200) < 1.2 * (work(200) - work(100)) * 2


@pytest.fixture
def results_folder(tmp_path: Path) -> Path:
    folder = tmp_path / "shard"
    (folder / "traces").mkdir(parents=True)
    (folder / "traces" / "a.npz").write_text("trace")
    (tmp_path / "secret").write_text("secret")
    return folder


def test_a_trace_is_found_beside_its_results_also_behind_a_link(results_folder: Path, tmp_path: Path) -> None:
    for name in ("traces/a.npz", "./traces//a.npz", "traces/../traces/a.npz"):
        assert artifacts.stored_file(results_folder, name) == (results_folder / "traces" / "a.npz").resolve()
    (tmp_path / "link").symlink_to(results_folder)
    assert artifacts.stored_file(tmp_path / "link", "traces/a.npz") == (results_folder / "traces" / "a.npz").resolve()


@pytest.mark.parametrize(
    "name",
    [
        *("../secret", "traces/../../secret", "/etc/hostname", "~/x", "", ".", "traces", "traces/nope.npz"),
        *("linked/a.npz", "traces/link.npz", "traces/pipe.npz", "a\0b", "x" * 5000, "loop"),
    ],
)
def test_what_is_outside_or_behind_a_link_or_no_file_is_not_found(results_folder: Path, name: str) -> None:
    (results_folder / "linked").symlink_to("traces")
    (results_folder / "loop").symlink_to("loop")
    (results_folder / "traces" / "link.npz").symlink_to("../../secret")
    os.mkfifo(results_folder / "traces" / "pipe.npz")
    assert artifacts.stored_file(results_folder, name) is None


def test_copies_replace_links_and_leave_no_parts(results_folder: Path, tmp_path: Path) -> None:
    # A copy replaces a link and not what it leads to.
    target = tmp_path / "b.npz"
    target.symlink_to("secret")
    artifacts.copy_stored(results_folder / "traces" / "a.npz", target)
    assert (target.read_text(), target.is_symlink()) == ("trace", False)
    assert (tmp_path / "secret").read_text() == "secret"
    # Nothing is left of a copy that failed.
    (results_folder / "link.npz").symlink_to("../secret")
    (tmp_path / "out").mkdir()
    with pytest.raises(OSError, match="link"):
        artifacts.copy_stored(results_folder / "link.npz", tmp_path / "out" / "b.npz")
    assert list((tmp_path / "out").iterdir()) == []


RUN = Outcome(name="a", file="a.sim.yml", status="passed", trace="traces/a.npz")
WHOLE = RUN.model_copy(update={"replay": "replays/a.json.gz", "recordings": ("recordings/a.mcap", "recordings/a.csv")})


def write_files(folder: Path) -> list[str]:
    """Write the files that the outcome names."""
    names = ["traces/a.npz", "replays/a.json.gz", "recordings/a.mcap", "recordings/a.csv"]
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(name)
    return names


def test_files_that_an_outcome_names_are_copied_under_the_name_of_the_new_trace(tmp_path: Path) -> None:
    shard, merged = tmp_path / "shard", tmp_path / "merged"
    names = write_files(shard)
    kinds = ("trace", "replay", "recording", "recording")
    files = [(file.kind, file.name, file.source) for file in artifacts.stored_files_of(WHOLE, shard)]
    assert files == [(kind, name, shard / name) for kind, name in zip(kinds, names, strict=True)]
    merged.mkdir()
    found = copied(WHOLE, shard, merged, "traces/a-2.npz")
    new = [found.trace, found.replay, *found.recordings]
    assert new == ["traces/a-2.npz", "replays/a-2.json.gz", "recordings/a-2.mcap", "recordings/a-2.csv"]
    assert [(merged / str(name)).read_text() for name in new] == names
    assert found.notes == ()


def copied(outcome: Outcome, source: Path | None, target: Path, name: str = "traces/a.npz") -> Outcome:
    return artifacts.with_copied_files(outcome, artifacts.stored_files_of(outcome, source), target / name, target)


def test_what_an_outcome_does_not_name_is_not_missed_and_a_replay_of_a_repetition_not_copied(tmp_path: Path) -> None:
    repeats = Repeats(count=3, agreed=2, digests=2, replay="replays/a-run-2.json.gz")
    flaky = WHOLE.model_copy(update={"repeats": repeats})
    assert copied(flaky, tmp_path, tmp_path).repeats == Repeats(count=3, agreed=2, digests=2)
    assert [file.kind for file in artifacts.stored_files_of(RUN, tmp_path)] == ["trace"]
    assert artifacts.stored_files_of(RUN.model_copy(update={"trace": None}), tmp_path) == []


def test_a_file_that_is_not_there_is_noted(tmp_path: Path) -> None:
    other = WHOLE.model_copy(update={"recordings": ("recordings/a.exe",)})
    for folder in (tmp_path, None):
        found = copied(other, folder, tmp_path)
        assert (found.trace, found.replay, found.recordings) == (None, None, ())
        assert found.notes == (
            "its trace traces/a.npz was not found next to the results of its shard",
            "its replay replays/a.json.gz was not found next to the results of its shard",
            "its recording recordings/a.exe was not found next to the results of its shard",
        )


def test_a_file_that_cannot_be_copied_is_a_note(tmp_path: Path) -> None:
    folder, merged = tmp_path / "one", tmp_path / "merged"
    write_files(folder)
    (merged / "traces/a-2.npz").mkdir(parents=True)
    (merged / "replays").touch()
    found = copied(WHOLE, folder, merged, "traces/a-2.npz")
    assert (found.trace, found.replay) == (None, None)
    assert [Path(name).parent.name for name in found.recordings] == ["recordings"] * len(WHOLE.recordings)
    assert found.notes == ("trace: is a directory", "replay: file exists")


def test_files_that_exist_stay_named(tmp_path: Path) -> None:
    write_files(tmp_path)
    assert artifacts.with_existing_files(WHOLE, tmp_path) is WHOLE


def test_files_that_do_not_exist_are_named_in_notes_alone(tmp_path: Path) -> None:
    (tmp_path / (WHOLE.trace or "")).mkdir(parents=True)
    (tmp_path / "target").touch()
    (tmp_path / (WHOLE.replay or "")).parent.mkdir()
    (tmp_path / (WHOLE.replay or "")).symlink_to(tmp_path / "target")
    found = artifacts.with_existing_files(WHOLE, tmp_path)
    assert (found.trace, found.replay, found.recordings) == (None, None, ())
    kinds = ["trace", "replay", *(f"{Path(name).suffix[1:]} recording" for name in WHOLE.recordings)]
    assert found.notes == tuple(f"{kind}: it was removed after the run" for kind in kinds)
    assert artifacts.with_existing_files(found, tmp_path) is found
    strange = WHOLE.model_copy(update={"trace": "a\0b", "replay": "x" * 5000})
    assert artifacts.with_existing_files(strange, tmp_path).trace is None
