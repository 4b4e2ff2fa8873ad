"""The motion of a run in a file: read as it was written, and never more than numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_action.state.motion_record import MotionRecord
from sim_action.state.trace_storage import TraceError

TIME = np.arange(5) / 240
POSES = np.arange(35, dtype=np.float64).reshape(5, 7)
MOTION = MotionRecord(
    TIME,
    POSES,
    joints={"elbow /\\..": TIME + 1, "rail": TIME + 2},
    units={"elbow /\\..": "rad", "rail": "m"},
    links={"tool": POSES + 1},
    bodies={"ball": POSES + 2, "box": POSES + 3},
    bolted=True,
)


def assert_equal(one: MotionRecord, other: MotionRecord) -> None:
    np.testing.assert_array_equal(one.time, other.time)
    np.testing.assert_array_equal(one.base, other.base)
    assert (one.units, one.bolted) == (other.units, other.bolted)
    for group in ("joints", "links", "bodies"):
        ours, theirs = getattr(one, group), getattr(other, group)
        assert list(ours) == list(theirs)
        for name in ours:
            np.testing.assert_array_equal(ours[name], theirs[name])


@pytest.mark.parametrize("motion", [MOTION, MotionRecord(TIME, POSES), MOTION.rows(np.arange(0))])
def test_a_motion_is_read_as_it_was_written(motion: MotionRecord, tmp_path: Path) -> None:
    motion.save(tmp_path / "a.npz")
    assert_equal(MotionRecord.load(tmp_path / "a.npz"), motion)


def test_rows_are_taken_of_all_columns() -> None:
    some = MOTION.rows(np.array([1, 3]))
    assert len(some) == 2
    np.testing.assert_array_equal(some.bodies["box"], POSES[[1, 3]] + 3)
    np.testing.assert_array_equal(some.joints["rail"], TIME[[1, 3]] + 2)


@pytest.mark.parametrize("column", ["time", "base", "joints", "links", "bodies"])
def test_a_number_that_is_none_is_found_in_every_column(column: str) -> None:
    assert MOTION.is_finite
    found: Any = getattr(MOTION, column)
    wrong = {name: values * np.nan for name, values in found.items()} if isinstance(found, dict) else found * np.nan
    assert not MotionRecord(**{**vars(MOTION), column: wrong}).is_finite


def forged(folder: Path, **changes: Any) -> Path:
    MOTION.save(folder / "a.npz")
    with np.load(folder / "a.npz") as stored:
        arrays = {**stored, **changes}
    np.savez(folder / "a.npz", **{name: array for name, array in arrays.items() if array is not None})
    return folder / "a.npz"


@pytest.mark.parametrize(
    "changes",
    [
        {"base": POSES[:3]},
        {"base": POSES.astype(np.float32)},
        {"time": POSES},
        {"joints_0": TIME[:2]},
        {"links_0": POSES[:, :3]},
        {"units": np.array(["rad"])},
        {"bodies_1": None},
        {"time": None},
        {"base": np.array([{"a": 1}], dtype=object)},
    ],
)
def test_a_file_of_another_form_is_refused(changes: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(TraceError, match="not a record of a motion"):
        MotionRecord.load(forged(tmp_path, **changes))


def test_what_is_no_file_of_its_own_is_refused(tmp_path: Path) -> None:
    MOTION.save(tmp_path / "a.npz")
    (tmp_path / "b.npz").symlink_to("a.npz")
    (tmp_path / "c.npz").write_bytes(b"PK")
    for name in ("b", "c", "d"):
        with pytest.raises(TraceError):
            MotionRecord.load(tmp_path / f"{name}.npz")
