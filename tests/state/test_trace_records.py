"""Records of clearance: made, cut, joined, stored."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_action.state import trace_records
from sim_action.state.readings import ContactReading
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels, ClearanceWatch
from sim_action.state.trace_storage import TraceError, load_trace, save_trace
from tests.traces import trace

NEAR = [
    trace_records.Nearness(0.1, 2.0, "base", "wall"),
    trace_records.Nearness(0.2, 1.5, "arm", "post"),
    trace_records.Nearness(0.3, -0.01, "base", "wall"),
    trace_records.Nearness(0.4, -0.02, "base", "post"),
]
RECORD = trace_records.ClearanceRecord.of(NEAR, ((0.1, 0.25), (0.3, math.inf)))
WATCHES = (ClearanceWatch(), ClearanceWatch(links=("base",), bodies=("wall", "post"), within=0.5, always=True))


def told(record: trace_records.ClearanceRecord) -> list[trace_records.Nearness]:
    return [record.at(index) for index in range(len(record))]


def test_pieces_make_the_whole_again_though_each_numbers_its_pairs_anew() -> None:
    assert told(RECORD) == NEAR
    assert len(trace_records.ClearanceRecord.of([])) == 0
    pieces = map(trace_records.ClearanceRecord.of, (NEAR[:1], [], NEAR[1:3], NEAR[3:]))
    assert told(trace_records.ClearanceRecord.concatenate(list(pieces))) == NEAR
    # The moments of a window are those at its ends, too.
    assert told(RECORD.between(0.2, 0.3)) == NEAR[1:3]
    assert told(RECORD.between(0.45, 9.0)) == []


def test_a_trace_cuts_joins_and_stores_them(tmp_path: Path) -> None:
    time = [0.1, 0.2, 0.3, 0.4]
    seen = replace(trace(time), clearances=dict.fromkeys(WATCHES, RECORD))
    assert told(seen.first(2).clearances[WATCHES[0]]) == NEAR[:2]
    assert told(seen.between(0.2, 0.3).clearances[WATCHES[1]]) == NEAR[1:3]
    assert told(seen.rows(slice(1)).clearances[WATCHES[0]]) == NEAR
    again = Trace.concatenate([seen.first(2), trace([]), seen.between(0.3, 0.4)])
    save_trace(again, tmp_path / "t.npz")
    stored = load_trace(tmp_path / "t.npz")
    assert list(stored.clearances) == list(WATCHES)
    assert [told(record) for record in stored.clearances.values()] == [NEAR, NEAR]
    assert {record.presence for record in stored.clearances.values()} == {RECORD.presence}
    # A file whose columns do not fit is no trace.
    broken = replace(RECORD, pair=np.array([0, 1, 7, 0]))
    save_trace(replace(trace([0.1]), clearances={WATCHES[0]: broken}), tmp_path / "t.npz")
    with pytest.raises(TraceError, match="not a trace"):
        load_trace(tmp_path / "t.npz")


READINGS = [ContactReading(time, time > 0.1, 10 * time, ("wall",)) for time in (0.0, 0.1, 0.2, 0.3)]


def test_readings_become_columns_at_their_own_times() -> None:
    record = trace_records.SensorRecord.of_readings("contact", READINGS)
    assert len(record) == 4
    assert record.time.tolist() == [0.0, 0.1, 0.2, 0.3]
    assert record.columns["touching"].tolist() == [0, 0, 1, 1]
    assert record.columns["force"].tolist() == [0.0, 1.0, 2.0, 3.0]
    # A record in pieces is the record.
    pieces = record.between(-1, 0.15), record.between(0.15, 0.17), record.between(0.2, 0.3)
    assert [len(piece) for piece in pieces] == [2, 0, 2]
    joined = trace_records.SensorRecord.concatenate(pieces)
    assert joined.time.tolist() == record.time.tolist()
    assert joined.columns["force"].tolist() == record.columns["force"].tolist()


TIME = np.array([0.1, 0.2, 0.3, 0.4])
RECORDS = (
    trace_records.BodyRecord(TIME, np.zeros((4, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (4, 1))),
    RECORD,
    trace_records.SensorRecord("contact", TIME, {"touching": np.zeros(4)}),
)


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: type(record).__name__)
@pytest.mark.parametrize(
    ("start", "end", "kept"),
    [(0.2, 0.3, [0.2, 0.3]), (0.1 + 0.2, 0.4, [0.3, 0.4]), (0.11, 0.19, []), (0.0, 0.1, [0.1]), (0.35, 9.0, [0.4])],
)
def test_records_between_two_times_keep_both_ends_in_spite_of_rounding(
    record: trace_records.BodyRecord | trace_records.ClearanceRecord | trace_records.SensorRecord,
    start: float,
    end: float,
    kept: list[float],
) -> None:
    assert record.between(start, end).time.tolist() == kept


def crate(*times: float) -> trace_records.BodyRecord:
    """A crate that moves along x with 1 m/s."""
    time, orientation = np.array(times), np.tile([0.0, 0.0, 0.0, 1.0], (len(times), 1))
    return trace_records.BodyRecord(time, np.outer(time, [1.0, 0.0, 0.0]), orientation)


def crates(*times: float) -> Trace:
    return replace(trace(times), objects={"crate": crate(*times)})


def where(seen: Trace) -> list[float]:
    record = seen.objects["crate"]
    assert record.time.tolist() == seen.time.tolist()
    return [float(x) for x in record.position_xyz[:, 0]]


def test_objects_are_cut_and_joined_with_the_state() -> None:
    seen = crates(0.1, 0.2, 0.3, 0.4)
    assert where(seen.first(2)) == [0.1, 0.2]
    assert where(seen.between(0.2, 0.3)) == [0.2, 0.3]
    assert where(seen.rows(np.array([0, 3]))) == [0.1, 0.4]
    assert where(Trace.concatenate((seen.first(1), seen.between(0.2, 9.0)))) == [0.1, 0.2, 0.3, 0.4]
    assert where(replace(seen, clearances={WATCHES[0]: RECORD}).between(0.2, 0.3)) == [0.2, 0.3]


def test_an_object_is_nowhere_until_it_appears() -> None:
    record = crate(0.1, 0.2, 0.3)
    late = record.within(0.2)
    assert np.isnan(late.position_xyz).all(axis=1).tolist() == [True, False, False]
    assert np.isnan(late.orientation_xyzw).all(axis=1).tolist() == [True, False, False]
    assert late.position_xyz[1:].tolist() == record.position_xyz[1:].tolist()
    assert np.isfinite(record.position_xyz).all()
    assert record.within(0.1) is record


def test_objects_are_stored_if_they_have_a_pose_for_each_moment(tmp_path: Path) -> None:
    seen = crates(0.1, 0.2)
    save_trace(seen, tmp_path / "t.npz")
    assert where(load_trace(tmp_path / "t.npz")) == [0.1, 0.2]
    save_trace(replace(seen, objects={"crate": crate(0.1, 0.3)}), tmp_path / "t.npz")
    with pytest.raises(TraceError, match="the object 'crate' has other times than the trace"):
        load_trace(tmp_path / "t.npz")


def foot(*touches: tuple[float, str]) -> trace_records.ContactRecord:
    """Contacts of a foot at these times with these bodies."""
    up = (0.0, 0.0, 1.0)
    return trace_records.ContactRecord.of(
        [(time, trace_records.LinkTouch("foot", body, (time, 0.0, 0.0), up, 10 * time)) for time, body in touches]
    )


STEPS = ((0.1, "ground"), (0.1, "ramp"), (0.3, "ramp"), (0.4, "ground"))


def touched(record: trace_records.ContactRecord) -> list[tuple[float, str]]:
    assert record.is_whole
    assert record.force.tolist() == [10 * time for time in record.time]
    return [(float(time), record.bodies[body]) for time, body in zip(record.time, record.body, strict=True)]


def test_contacts_of_links_are_cut_and_joined_with_the_state(tmp_path: Path) -> None:
    seen = replace(trace([0.1, 0.2, 0.3, 0.4]), link_contacts={"foot": foot(*STEPS)})
    assert touched(seen.first(2).link_contacts["foot"]) == list(STEPS[:2])
    assert touched(seen.between(0.2, 0.3).link_contacts["foot"]) == list(STEPS[2:3])
    assert touched(seen.rows(np.array([0, 3])).link_contacts["foot"]) == [*STEPS[:2], STEPS[3]]
    assert touched(seen.rows(slice(0)).link_contacts["foot"]) == []
    again = Trace.concatenate((seen.first(2), seen.rows(slice(0)), seen.between(0.3, 0.4)))
    assert touched(again.link_contacts["foot"]) == list(STEPS)
    save_trace(again, tmp_path / "t.npz")
    assert touched(load_trace(tmp_path / "t.npz").link_contacts["foot"]) == list(STEPS)
    # A file whose contacts do not fit is no trace.
    broken = replace(foot(*STEPS), body=np.array([0, 1, 2, 0]))
    save_trace(replace(trace([0.1]), link_contacts={"foot": broken}), tmp_path / "t.npz")
    with pytest.raises(TraceError, match="not a trace"):
        load_trace(tmp_path / "t.npz")


def test_a_contact_knows_its_moment() -> None:
    record = foot(*STEPS)
    assert record.moment(np.array([0.1, 0.2, 0.4])).tolist() == [0, 0, -1, 2]
    assert record.moment(np.array([])).tolist() == [-1, -1, -1, -1]
    assert foot().moment(np.array([0.1])).tolist() == []


def test_a_joint_keeps_its_commanded_position_until_the_next_one() -> None:
    told = trace_records.CommandedValues.of([(0.1, {"a": 1.0}), (0.2, {"b": 5.0}), (0.4, {"a": np.nan})])
    time = np.array([0.0, 0.1, 0.3, 0.4])
    np.testing.assert_array_equal(told.at("a", time), [np.nan, 1.0, 1.0, np.nan])
    np.testing.assert_array_equal(told.at("b", time), [np.nan, np.nan, 5.0, 5.0])
    np.testing.assert_array_equal(told.at("c", time), [np.nan] * 4)
    np.testing.assert_array_equal(trace_records.CommandedValues().at("a", time), [np.nan] * 4)


WALL = ClearanceWatch(bodies=("wall",))
ALL = Channels(
    contacts=True,
    clearances=frozenset({WALL, ClearanceWatch()}),
    sensors=frozenset({"scan", "imu"}),
    bodies=frozenset({"ball"}),
    objects=frozenset({"crate", "ball"}),
    link_contacts=frozenset({"foot", "hand"}),
    openings=frozenset({0.0, 2.0}),
)


def test_what_any_of_them_asks_for_is_asked_for() -> None:
    several = [
        Channels(contacts=True).opening_at(2.0),
        Channels(clearances=frozenset({WALL}), sensors=frozenset({"scan"}), objects=frozenset({"crate"})),
        Channels(bodies=frozenset({"ball"}), objects=frozenset({"ball"}), link_contacts=frozenset({"foot"})),
        Channels(link_contacts=frozenset({"hand"})),
        Channels(clearances=frozenset({ClearanceWatch(), WALL}), sensors=frozenset({"imu"})).opening_at(0.0),
    ]
    assert Channels.all_of(several) == Channels.all_of(reversed(several)) == ALL
    assert Channels.all_of([]) == Channels()
    assert not Channels().contacts
    # It crosses into the process of a scenario.
    assert pickle.loads(pickle.dumps(ALL)) == ALL
