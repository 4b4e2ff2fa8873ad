"""Headers of CSV logs."""

from __future__ import annotations

import pytest

from sim_action.commands.logs import JointColumn
from sim_action.commands.logs.csv_log import MOST_COLUMNS, Header, HeaderError


def test_a_header_of_twists() -> None:
    header = Header.of(["time", "angular"])
    assert header.holds_twists
    assert not header.joint_names


def test_a_header_of_joints_whose_names_may_have_dots() -> None:
    header = Header.of(["position.arm.elbow", "time", "velocity.wheel"])
    assert not header.holds_twists
    assert header.joint_names == {"arm.elbow", "wheel"}
    assert header.joints == (JointColumn("position", "arm.elbow"), None, JointColumn("velocity", "wheel"))


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (["time", "linaer"], "unknown column 'linaer'; did you mean 'linear'?"),
        (["time", "linear", "position."], "unknown column 'position.'"),
        (["time", "linear", ""], "unknown column ''"),
        (["time", "linear", "linear"], "2 columns are named 'linear'"),
        (["time;linear;angular"], "columns are separated by commas"),
        (["linear"], "no column 'time'"),
        (["time"], "nothing is commanded beside 'time' (allowed: angular, effort.<joint>"),
        (["time", "linear", "position.a"], "'linear' is of a base, 'position.a' of a joint"),
        (["time", *(f"position.{n}" for n in range(MOST_COLUMNS))], "1,001 columns; no more than 1,000"),
    ],
)
def test_a_header_that_tells_nothing_to_replay_is_refused(columns: list[str], message: str) -> None:
    with pytest.raises(HeaderError) as raised:
        Header.of(columns)
    assert message in str(raised.value)
