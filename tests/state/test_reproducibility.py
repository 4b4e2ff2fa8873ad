"""The first difference between two traces."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from sim_action.state.reproducibility import Digest, Divergence, Transcript, first_divergence
from sim_action.state.trace import Trace
from tests.traces import trace

TIME = [0.0, 0.25, 0.5, 0.75]


def changed(seen: Trace, row: int, column: int, value: float) -> Trace:
    state = seen.state.copy()
    state[row, column] = value
    return dataclasses.replace(seen, state=state)


def test_a_trace_does_not_differ_from_itself() -> None:
    seen = changed(trace(TIME, x=TIME), 2, 3, np.nan)
    assert first_divergence(seen, changed(seen, 0, 0, 0.0)) is None


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
    found = first_divergence(seen, changed(seen, 2, column, 9.0))
    assert found == Divergence(0.5, name, (float(seen.state[2, column]), 9.0))


def test_the_first_moment_counts_and_in_it_the_first_column() -> None:
    seen = trace(TIME)
    found = first_divergence(seen, changed(changed(changed(seen, 3, 1, 1.0), 2, 9, 2.0), 2, 8, 3.0))
    assert found == Divergence(0.5, "x of base_linear_xyz", (0.0, 3.0))


def test_it_is_as_exact_as_a_digest() -> None:
    seen = trace(TIME, x=TIME)
    assert first_divergence(seen, changed(seen, 1, 1, float(np.nextafter(0.25, 1)))) is not None
    assert first_divergence(seen, changed(seen, 1, 2, -0.0)) is not None


def test_one_that_was_over_first() -> None:
    seen = trace(TIME)
    assert first_divergence(seen, seen.rows(slice(2))) == Divergence(0.25, "", (0.75, 0.25))


def test_traces_of_other_robots_have_nothing_in_common() -> None:
    seen = trace(TIME)
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
