"""Stored traces and records of motion: what is written is read, and nothing else is a trace."""

from __future__ import annotations

import contextlib
import io
import os
import pickle
import sys
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.state.observation import SelfContact
from sim_action.state.trace import Trace
from sim_action.state.trace_records import SensorRecord
from sim_action.state.trace_storage import MotionRecord, TraceError, load_trace, save_trace
from tests.traces import SEEN, assert_same, columns, contact, trace


@pytest.mark.parametrize("seen", [SEEN, SEEN.first(1), trace([0.5]), trace([])], ids=["full", "one", "bare", "empty"])
def test_what_is_saved_is_loaded(seen: Trace, tmp_path: Path) -> None:
    save_trace(seen, tmp_path / "trace.npz")
    assert_same(load_trace(tmp_path / "trace.npz"), seen)


def test_names_of_any_language_and_contacts_without_a_force_are_stored(tmp_path: Path) -> None:
    odd = contact(0.1, body="mur épais", link="機"), contact(0.1, force=0.0)._replace(has_force=False, depth=0.01)
    seen = trace([0.1], contacts=[contact(0.1), *odd])
    save_trace(seen, tmp_path / "trace.npz")
    assert load_trace(tmp_path / "trace.npz").contacts == seen.contacts


def test_contacts_between_links_are_stored_and_cut(tmp_path: Path) -> None:
    touches = tuple(SelfContact(time, "base", "hand", (1.0, 2.0, 3.0), 5.0, 0.001) for time in (0.1, 0.2))
    seen = replace(trace([0.1, 0.2]), self_contacts=touches)
    save_trace(seen, tmp_path / "trace.npz")
    found = load_trace(tmp_path / "trace.npz")
    assert found.self_contacts == touches
    assert found.first(1).self_contacts == touches[:1]
    assert found.between(0.15, 0.2).self_contacts == touches[1:]
    assert Trace.concatenate([found.first(1), found.between(0.15, 0.2)]).self_contacts == touches


def test_contacts_of_older_traces_have_a_force(tmp_path: Path) -> None:
    np.savez(tmp_path / "trace.npz", **arrays())
    assert [found.has_force for found in load_trace(tmp_path / "trace.npz").contacts] == [True]


def arrays(**changes: Any) -> dict[str, Any]:
    """What `save_trace` writes, changed; None leaves an array out."""
    found = {**_saved(), **changes}
    return {name: value for name, value in found.items() if value is not None}


def _saved() -> dict[str, Any]:
    touches = {
        "contact_time": np.array([0.1]),
        "contact_link": np.array(["a"]),
        "contact_body": np.array(["b"]),
        "contact_position_xyz": np.zeros((1, 3)),
        "contact_force": np.array([1.0]),
    }
    return {"joint_names": np.array(SEEN.joint_names), **columns(SEEN), **touches}


@pytest.mark.parametrize(
    "changes",
    [
        {"time": None},
        {"joint_names": None},
        {"contact_force": None},
        {"time": np.zeros((4, 1))},
        {"time": np.zeros(3)},
        {"time": np.zeros(())},
        {"base_position_xyz": np.zeros((4, 2))},
        {"base_orientation_xyzw": np.zeros((4, 3))},
        {"joint_position": np.zeros((4, 3))},
        {"joint_velocity": np.zeros((3, 2))},
        {"base_linear_xyz": np.full((4, 3), "fast")},
        {"base_linear_xyz": np.zeros((4, 3), dtype=np.complex128)},
        {"contact_position_xyz": np.zeros((1, 2))},
        {"contact_time": np.zeros(2)},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_a_file_with_wrong_arrays_is_no_trace(changes: dict[str, Any], tmp_path: Path) -> None:
    np.savez(tmp_path / "trace.npz", **arrays(**changes))
    with pytest.raises(TraceError, match=r"trace.npz: not a trace: "):
        load_trace(tmp_path / "trace.npz")


class Trap:
    """Leaves a mark if it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return (Path.touch, (self.path,))


def test_a_pickle_is_never_opened(tmp_path: Path) -> None:
    mark, trap = tmp_path / "mark", np.array([Trap(tmp_path / "mark")], dtype=object)
    np.savez(tmp_path / "a.npz", **arrays(joint_names=trap))
    np.save(tmp_path / "b.npy", trap)
    (tmp_path / "c.npz").write_bytes(pickle.dumps(Trap(mark)))
    for name in ("a.npz", "b.npy", "c.npz"):
        with pytest.raises(TraceError):
            load_trace(tmp_path / name)
    assert not mark.exists()


def _npy() -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, np.zeros(3))
    return buffer.getvalue()


def _zip(content: bytes) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as file:
        file.writestr("joint_names.npy", content)
    return buffer.getvalue()


HUGE = (
    b"\x93NUMPY\x01\x00v\x00"
    + b"{'descr': '<f8', 'fortran_order': False, 'shape': (10000000000000,), }".ljust(117)
    + b"\n"
)


@pytest.mark.parametrize(
    "content",
    [b"", b"x", b"\x00" * 1000, b"PK\x03\x04", b"{}", _npy(), _zip(b""), _zip(b"garbage"), _zip(HUGE)],
    ids=["empty", "letter", "zeros", "zip head", "json", "npy", "empty array", "garbage array", "80 TB"],
)
def test_garbage_is_no_trace(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "trace.npz").write_bytes(content)
    for path in (tmp_path / "trace.npz", tmp_path / "absent.npz", tmp_path):
        with pytest.raises(TraceError):
            load_trace(path)


@given(st.integers(0, 4000), st.integers(0, 255))
def test_a_trace_with_a_wrong_byte_is_a_trace_or_an_error(tmp_path_factory: Any, at: int, byte: int) -> None:
    folder = tmp_path_factory.mktemp("trace")
    save_trace(SEEN, folder / "trace.npz")
    content = bytearray((folder / "trace.npz").read_bytes())
    content[at % len(content)] = byte
    (folder / "trace.npz").write_bytes(content)
    with contextlib.suppress(TraceError):
        assert len(load_trace(folder / "trace.npz")) == 4


def test_readings_are_stored_whatever_the_sensors_name(tmp_path: Path) -> None:
    forces = SensorRecord("contact", np.array([0.0, 0.2, 0.4]), {"force": np.array([1.0, 2.0, 3.0])})
    frames = SensorRecord("camera", np.array([0.1]), {"rgb": np.full((1, 2, 2, 3), 7, dtype=np.uint8)})
    save_trace(replace(SEEN, sensors={"a/b": forces, "../eye": frames}), tmp_path / "t.npz")
    loaded = load_trace(tmp_path / "t.npz")
    assert loaded.sensors["a/b"].columns["force"].tolist() == [1.0, 2.0, 3.0]
    assert loaded.sensors["a/b"].kind == "contact"
    assert loaded.sensors["a/b"].time.tolist() == [0.0, 0.2, 0.4]
    assert loaded.sensors["../eye"].columns["rgb"].dtype == np.uint8
    save_trace(SEEN, tmp_path / "t.npz")
    assert load_trace(tmp_path / "t.npz").sensors == {}


@pytest.mark.skipif(sys.platform == "win32", reason="there are no such files")
def test_what_is_no_file_holds_nobody_up(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "trace.npz")
    with pytest.raises(TraceError, match="it is not a regular file"):
        load_trace(tmp_path / "trace.npz")


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
