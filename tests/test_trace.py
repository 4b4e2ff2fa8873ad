"""Traces: slicing, derived signals, storage, digest."""

from __future__ import annotations

import contextlib
import io
import math
import pickle
import zipfile
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.digest import Digest
from sim_action.geometry import Pose, Twist
from sim_action.observation import JointState, Observation
from sim_action.sensor_record import SensorRecord
from sim_action.trace import COLUMNS, Trace, TraceError
from tests.traces import contact, trace

TOUCHES = (contact(0.1), contact(0.25), contact(0.3))
SEEN = trace(
    [0.1, 0.2, 0.3, 0.4],
    x=[1.0, 2.0, 3.0, 4.0],
    y=[0.0, 0.0, 4.0, 3.0],
    z=[0.0, 0.0, 0.0, 12.0],
    roll=[0.0, 0.5, -1.0, math.pi],
    yaw=[0.0, 1.0, 3.0, -3.0],
    speed=[1.0, -2.0, 0.0, 0.5],
    turn_rate=[0.0, -0.5, 0.0, 0.0],
    position=[0.0, 0.1, 0.2, 0.3],
    velocity=[1.0, 1.0, 1.0, 1.0],
    effort=[0.0, 0.0, 0.0, 9.0],
    contacts=TOUCHES,
)


def times(seen: Trace) -> list[float]:
    return [float(time) for time in seen.time]


def contact_times(seen: Trace) -> list[float]:
    return [touch.time for touch in seen.contacts]


def test_a_trace_is_as_long_as_its_moments() -> None:
    assert len(SEEN) == 4
    assert len(trace([])) == 0


def test_the_first_moments_come_with_the_contacts_up_to_the_last_of_them() -> None:
    assert times(SEEN.first(2)) == [0.1, 0.2]
    assert contact_times(SEEN.first(2)) == [0.1]
    assert contact_times(SEEN.first(3)) == [0.1, 0.25, 0.3]


def test_rows_leave_all_contacts() -> None:
    every_other = SEEN.rows(slice(None, None, 2))
    assert times(every_other) == [0.1, 0.3]
    assert every_other.base_position_xyz.tolist() == [[1, 0, 0], [3, 4, 0]]
    assert every_other.contacts == TOUCHES
    assert SEEN.rows(slice(0)).contacts == TOUCHES


@pytest.mark.parametrize(
    ("start", "end", "moments", "touches"),
    [
        (0.0, math.inf, [0.1, 0.2, 0.3, 0.4], [0.1, 0.25, 0.3]),
        (0.2, 0.3, [0.2, 0.3], [0.25, 0.3]),
        (0.2 + 1e-12, 0.3 - 1e-12, [0.2, 0.3], [0.25, 0.3]),
        (0.21, 0.29, [], [0.25]),
        (0.0, 0.05, [], []),
        (0.5, math.inf, [], []),
        (0.4, 0.4, [0.4], []),
    ],
)
def test_between_keeps_both_ends(start: float, end: float, moments: list[float], touches: list[float]) -> None:
    inside = SEEN.between(start, end)
    assert times(inside) == moments
    assert contact_times(inside) == touches


def test_between_drops_contacts_outside_though_all_moments_are_inside() -> None:
    assert contact_times(SEEN.rows(slice(1, 3)).between(0.2, 0.3)) == [0.25, 0.3]


def test_between_of_nothing_is_nothing() -> None:
    assert len(trace([]).between(0.0, 1.0)) == 0


def test_speeds_are_magnitudes() -> None:
    assert SEEN.speed.tolist() == [1.0, 2.0, 0.0, 0.5]
    assert SEEN.turn_rate.tolist() == [0.0, 0.5, 0.0, 0.0]


def test_tilt_is_the_angle_to_the_vertical_whatever_the_heading() -> None:
    assert SEEN.tilt == pytest.approx([0.0, 0.5, 1.0, math.pi])
    assert trace([0.1], yaw=[2.0]).tilt == pytest.approx([0.0])


def test_yaw_is_the_heading() -> None:
    assert trace([0.1, 0.2], yaw=[1.0, -3.0]).yaw == pytest.approx([1.0, -3.0])


def test_a_heading_error_takes_the_short_way_round() -> None:
    turned = trace([0.1, 0.2], yaw=[3.0, -3.0])
    assert turned.yaw_error_to(-3.0) == pytest.approx([2 * math.pi - 6.0, 0.0])
    assert turned.yaw_error_to(3.0 + 4 * math.pi) == pytest.approx([0.0, 2 * math.pi - 6.0])


def test_distances_are_in_space_or_on_the_ground() -> None:
    assert SEEN.distance_to((0.0, 0.0, 0.0)).tolist() == [1.0, 2.0, 5.0, 13.0]
    assert SEEN.planar_distance_to(0.0, 0.0).tolist() == [1.0, 2.0, 5.0, 5.0]


def test_arc_length_begins_where_the_robot_was() -> None:
    path = trace([0.1, 0.2, 0.3], x=[1.0, 1.0, 0.0], y=[0.0, 2.0, 2.0])
    assert path.arc_length_from((0.0, 0.0, 0.0)).tolist() == [1.0, 3.0, 4.0]
    assert path.arc_length_from((0.0, 0.0, 0.0), 10.0).tolist() == [11.0, 13.0, 14.0]


def test_an_observation_is_a_trace_of_one_moment() -> None:
    joints = {"a": JointState(1.0, 2.0, 3.0), "b": JointState(4.0, 5.0, 6.0)}
    seen = Observation(0.5, Pose((1, 2, 3), (0, 0, 1, 0)), Twist((4, 5, 6), (7, 8, 9)), joints, TOUCHES)
    one = Trace.of_observation(seen)
    assert (len(one), one.joint_names, one.contacts) == (1, ("a", "b"), ())
    assert one.state.tolist() == [[0.5, 1, 2, 3, 0, 0, 1, 0, 4, 5, 6, 7, 8, 9, 1, 4, 2, 5, 3, 6]]
    assert one.joint_velocity.tolist() == [[2, 5]]


def test_an_observation_without_joints_is_a_trace_too() -> None:
    assert Trace.of_observation(Observation(0.0, Pose(), Twist(), {})).state.shape == (1, 14)


def columns(seen: Trace) -> dict[str, Any]:
    return {name: getattr(seen, name) for name in COLUMNS}


def assert_same(one: Trace, other: Trace) -> None:
    assert one.joint_names == other.joint_names
    assert one.contacts == other.contacts
    for name, values in columns(one).items():
        np.testing.assert_array_equal(values, columns(other)[name], strict=True)


cuts = st.lists(st.integers(0, 4), max_size=5)


def pieces(seen: Trace, at: list[int]) -> list[Trace]:
    """The trace cut before the rows named, with each contact in the piece of the next moment."""
    found = []
    for start, end in pairwise(sorted({0, *at, len(seen)})):
        since = seen.time[start - 1] if start else -math.inf
        here = tuple(c for c in seen.contacts if since < c.time <= seen.time[end - 1])
        found.append(replace(seen.rows(slice(start, end)), contacts=here))
    return found


@given(cuts)
def test_pieces_put_together_are_the_whole(at: list[int]) -> None:
    assert_same(Trace.concatenate(pieces(SEEN, at)), SEEN)


@given(cuts)
def test_a_digest_is_the_same_however_the_steps_are_cut(at: list[int]) -> None:
    whole, cut = Digest(), Digest()
    whole.add(SEEN)
    for piece in pieces(SEEN, at):
        cut.add(piece)
    assert cut.hexdigest() == whole.hexdigest()
    assert len(whole.hexdigest()) == 64


@pytest.mark.parametrize("name", COLUMNS)
def test_a_digest_tells_states_apart_that_differ_in_one_bit(name: str) -> None:
    changed = {key: value.copy() for key, value in columns(SEEN).items()}
    changed[name].flat[0] = np.nextafter(changed[name].flat[0], 1e9)
    one, other = Digest(), Digest()
    one.add(SEEN)
    other.add(Trace.of_columns(joint_names=SEEN.joint_names, **changed))
    assert one.hexdigest() != other.hexdigest()


def test_a_digest_of_fewer_steps_is_another() -> None:
    one, other = Digest(), Digest()
    one.add(SEEN)
    other.add(SEEN.first(3))
    assert one.hexdigest() != other.hexdigest()


@pytest.mark.parametrize("seen", [SEEN, SEEN.first(1), trace([0.5]), trace([])], ids=["full", "one", "bare", "empty"])
def test_what_is_saved_is_loaded(seen: Trace, tmp_path: Path) -> None:
    seen.save(tmp_path / "trace.npz")
    assert_same(Trace.load(tmp_path / "trace.npz"), seen)


def test_names_of_any_language_are_stored(tmp_path: Path) -> None:
    seen = trace([0.1], contacts=[contact(0.1, body="mur épais", link="機")])
    seen.save(tmp_path / "trace.npz")
    assert Trace.load(tmp_path / "trace.npz").contacts == seen.contacts


def arrays(**changes: Any) -> dict[str, Any]:
    """What `save` writes, changed; None leaves an array out."""
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
        Trace.load(tmp_path / "trace.npz")


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
            Trace.load(tmp_path / name)
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
    with pytest.raises(TraceError):
        Trace.load(tmp_path / "trace.npz")


def test_a_missing_file_and_a_folder_are_no_traces(tmp_path: Path) -> None:
    for path in (tmp_path / "absent.npz", tmp_path):
        with pytest.raises(TraceError):
            Trace.load(path)


@given(st.integers(0, 4000), st.integers(0, 255))
def test_a_trace_with_a_wrong_byte_is_a_trace_or_an_error(tmp_path_factory: Any, at: int, byte: int) -> None:
    folder = tmp_path_factory.mktemp("trace")
    SEEN.save(folder / "trace.npz")
    content = bytearray((folder / "trace.npz").read_bytes())
    content[at % len(content)] = byte
    (folder / "trace.npz").write_bytes(content)
    with contextlib.suppress(TraceError):
        assert len(Trace.load(folder / "trace.npz")) == 4


RECORD = SensorRecord("contact", np.array([0.0, 0.2, 0.4]), {"force": np.array([1.0, 2.0, 3.0])})


def told(seen: Trace) -> list[float]:
    return [] if not seen.sensors else seen.sensors["a/b"].columns["force"].tolist()


def test_readings_are_cut_and_joined_with_the_moments() -> None:
    seen = replace(SEEN, sensors={"a/b": RECORD})
    assert told(seen.first(2)) == [1.0, 2.0]
    assert told(seen.between(0.2, 0.3)) == [2.0]
    assert told(Trace.concatenate((seen.between(0, 0.3), SEEN.rows(slice(0)), seen.between(0.31, 0.4)))) == [1, 2, 3]
    assert told(Trace.concatenate((SEEN.rows(slice(1)), seen))) == [1, 2, 3]


def test_readings_are_stored_whatever_the_sensors_name(tmp_path: Path) -> None:
    frames = SensorRecord("camera", np.array([0.1]), {"rgb": np.full((1, 2, 2, 3), 7, dtype=np.uint8)})
    replace(SEEN, sensors={"a/b": RECORD, "../eye": frames}).save(tmp_path / "t.npz")
    loaded = Trace.load(tmp_path / "t.npz")
    assert told(loaded) == [1.0, 2.0, 3.0]
    assert loaded.sensors["a/b"].kind == "contact"
    assert loaded.sensors["a/b"].time.tolist() == [0.0, 0.2, 0.4]
    assert loaded.sensors["../eye"].columns["rgb"].dtype == np.uint8
    SEEN.save(tmp_path / "t.npz")
    assert Trace.load(tmp_path / "t.npz").sensors == {}
