"""Traces: slicing, derived signals, digest."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.geometry import Pose, Twist, multiply
from sim_action.state.observation import JointState, Observation
from sim_action.state.trace import COLUMNS, Digest, Divergence, Trace, Transcript, first_divergence
from sim_action.state.trace_records import SensorRecord
from tests.traces import SEEN, assert_same, columns, trace


def times(seen: Trace) -> list[float]:
    return [float(time) for time in seen.time]


def contact_times(seen: Trace) -> list[float]:
    return [touch.time for touch in seen.contacts]


def test_the_first_moments_come_with_the_contacts_up_to_the_last_of_them() -> None:
    assert times(SEEN.first(2)) == [0.1, 0.2]
    assert contact_times(SEEN.first(2)) == [0.1]
    assert contact_times(SEEN.first(3)) == [0.1, 0.25, 0.3]
    assert (len(SEEN), len(trace([]))) == (4, 0)
    # Rows leave all contacts.
    every_other = SEEN.rows(slice(None, None, 2))
    assert times(every_other) == [0.1, 0.3]
    assert every_other.base_position_xyz.tolist() == [[1, 0, 0], [3, 4, 0]]
    assert every_other.contacts == SEEN.contacts
    assert SEEN.rows(slice(0)).contacts == SEEN.contacts


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
    assert len(trace([]).between(0.0, 1.0)) == 0


def test_speeds_are_magnitudes_and_tilt_is_the_angle_to_the_vertical_whatever_the_heading() -> None:
    assert SEEN.speed.tolist() == [1.0, 2.0, 0.0, 0.5]
    assert SEEN.turn_rate.tolist() == [0.0, 0.5, 0.0, 0.0]
    assert SEEN.tilt == pytest.approx([0.0, 0.5, 1.0, math.pi])
    assert trace([0.1], yaw=[2.0]).tilt == pytest.approx([0.0])


def test_yaw_is_the_heading_and_its_error_takes_the_short_way_round() -> None:
    assert trace([0.1, 0.2], yaw=[1.0, -3.0]).yaw == pytest.approx([1.0, -3.0])
    turned = trace([0.1, 0.2], yaw=[3.0, -3.0])
    assert turned.yaw_error_to(-3.0) == pytest.approx([2 * math.pi - 6.0, 0.0])
    assert turned.yaw_error_to(3.0 + 4 * math.pi) == pytest.approx([0.0, 2 * math.pi - 6.0])


@given(
    st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda numbers: math.hypot(*numbers) > 0.1),
    st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda numbers: math.hypot(*numbers) > 0.1),
    st.floats(0.0, math.pi) | st.floats(0.0, 1e-8) | st.floats(math.pi - 1e-8, math.pi),
    st.sampled_from([1.0, -1.0]),
)
def test_the_angle_of_a_rotation_is_exact_also_if_it_is_small(
    start: tuple[float, ...], axis: tuple[float, ...], angle: float, sign: float
) -> None:
    x, y, z, w = (number / math.hypot(*start) for number in start)
    ax, ay, az = (math.sin(angle / 2) * number / math.hypot(*axis) for number in axis)
    turned = multiply((ax, ay, az, math.cos(angle / 2)), (x, y, z, w))
    seen = replace(SEEN, state=SEEN.state.copy())
    seen.base_orientation_xyzw[:] = np.multiply(sign, turned)
    assert seen.rotation_to((x, y, z, w)) == pytest.approx([angle] * len(seen), abs=1e-14 if angle < 1 else 1e-7)


def test_distances_are_in_space_or_on_the_ground_and_arc_length_begins_where_the_robot_was() -> None:
    assert SEEN.distance_to((0.0, 0.0, 0.0)).tolist() == [1.0, 2.0, 5.0, 13.0]
    assert SEEN.planar_distance_to(0.0, 0.0).tolist() == [1.0, 2.0, 5.0, 5.0]
    path = trace([0.1, 0.2, 0.3], x=[1.0, 1.0, 0.0], y=[0.0, 2.0, 2.0])
    assert path.arc_length_from((0.0, 0.0, 0.0)).tolist() == [1.0, 3.0, 4.0]
    assert path.arc_length_from((0.0, 0.0, 0.0), 10.0).tolist() == [11.0, 13.0, 14.0]


def test_an_observation_is_a_trace_of_one_moment() -> None:
    joints = {"a": JointState(1.0, 2.0, 3.0), "b": JointState(4.0, 5.0, 6.0)}
    seen = Observation(0.5, Pose((1, 2, 3), (0, 0, 1, 0)), Twist((4, 5, 6), (7, 8, 9)), joints, SEEN.contacts)
    one = Trace.of_observation(seen)
    assert (len(one), one.joint_names, one.contacts) == (1, ("a", "b"), ())
    assert one.state.tolist() == [[0.5, 1, 2, 3, 0, 0, 1, 0, 4, 5, 6, 7, 8, 9, 1, 4, 2, 5, 3, 6]]
    assert one.joint_velocity.tolist() == [[2, 5]]
    assert Trace.of_observation(Observation(0.0, Pose(), Twist(), {})).state.shape == (1, 14)


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
    # A digest of fewer steps is another.
    fewer = Digest()
    fewer.add(SEEN.first(3))
    assert fewer.hexdigest() != whole.hexdigest()


@pytest.mark.parametrize("name", COLUMNS)
def test_a_digest_tells_states_apart_that_differ_in_one_bit(name: str) -> None:
    changed = {key: value.copy() for key, value in columns(SEEN).items()}
    changed[name].flat[0] = np.nextafter(changed[name].flat[0], 1e9)
    one, other = Digest(), Digest()
    one.add(SEEN)
    other.add(Trace.of_columns(joint_names=SEEN.joint_names, **changed))
    assert one.hexdigest() != other.hexdigest()


RECORD = SensorRecord("contact", np.array([0.0, 0.2, 0.4]), {"force": np.array([1.0, 2.0, 3.0])})


def told(seen: Trace) -> list[float]:
    return [] if not seen.sensors else seen.sensors["a/b"].columns["force"].tolist()


def test_readings_are_cut_and_joined_with_the_moments() -> None:
    seen = replace(SEEN, sensors={"a/b": RECORD})
    assert told(seen.first(2)) == [1.0, 2.0]
    assert told(seen.between(0.2, 0.3)) == [2.0]
    assert told(Trace.concatenate((seen.between(0, 0.3), SEEN.rows(slice(0)), seen.between(0.31, 0.5)))) == [1, 2, 3]
    # What is read at a moment is told with the next one.
    assert told(seen.between(0.31, 0.4)) == []
    assert told(Trace.concatenate((SEEN.rows(slice(1)), seen))) == [1, 2, 3]


TIME = [0.0, 0.25, 0.5, 0.75]


def changed(seen: Trace, row: int, column: int, value: float) -> Trace:
    state = seen.state.copy()
    state[row, column] = value
    return dataclasses.replace(seen, state=state)


@pytest.mark.parametrize(
    ("column", "name"),
    [
        (0, "time"),
        (1, "x of base_position_xyz"),
        (3, "z of base_position_xyz"),
        (7, "w of base_orientation_xyzw"),
        (8, "x of base_linear_xyz"),
        (13, "z of base_angular_xyz"),
        (14, "joint_position of wheel_left_joint"),
        (17, "joint_velocity of wheel_right_joint"),
        (19, "joint_effort of wheel_right_joint"),
    ],
)
def test_every_column_is_named(column: int, name: str) -> None:
    seen = trace(TIME)
    divergence = first_divergence(seen, changed(seen, 2, column, 9.0))
    assert divergence == Divergence(0.5, name, (float(seen.state[2, column]), 9.0))


def test_the_first_moment_counts_and_in_it_the_first_column() -> None:
    seen = trace(TIME)
    found = first_divergence(seen, changed(changed(changed(seen, 3, 1, 1.0), 2, 9, 2.0), 2, 8, 3.0))
    assert found == Divergence(0.5, "x of base_linear_xyz", (0.0, 3.0))


def test_it_is_as_exact_as_a_digest() -> None:
    same = changed(trace(TIME, x=TIME), 2, 3, np.nan)
    assert first_divergence(same, changed(same, 0, 0, 0.0)) is None
    seen = trace(TIME, x=TIME)
    assert first_divergence(seen, changed(seen, 1, 1, float(np.nextafter(0.25, 1)))) is not None
    assert first_divergence(seen, changed(seen, 1, 2, -0.0)) is not None


def test_one_that_was_over_first_and_one_of_another_robot() -> None:
    seen = trace(TIME)
    assert first_divergence(seen, seen.rows(slice(2))) == Divergence(0.25, "", (0.75, 0.25))
    with pytest.raises(ValueError, match="different joints"):
        first_divergence(seen, dataclasses.replace(seen, joint_names=("a", "b")))


def digest_of(*received: tuple[float, str, bytes], end: float = 1.0) -> str:
    found, transcript = Digest(), Transcript()
    for time, sender, message in received:
        transcript.add(time, sender, message)
    found.add_transcript(transcript, end)
    return found.hexdigest()


def test_a_digest_covers_messages() -> None:
    first = (0.5, "/cmd_vel", b"1")
    others = [(0.6, "/cmd_vel", b"1"), (0.5, "/cmd", b"1"), (0.5, "/cmd_vel", b"2")]
    assert digest_of(first) == digest_of(first, (1.0, "/cmd_vel", b"after the end"))
    assert len({digest_of(), digest_of(first), digest_of(first, first), *map(digest_of, others)}) == 6
