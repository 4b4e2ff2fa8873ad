"""Golden trajectories as files: what is written, what is read again, and what is told of other files."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.state.golden_trajectory import Golden, GoldenError, GoldenForm, interpolated, is_golden, wrapped
from sim_action.state.trace import Trace
from tests.traces import WHEELS, trace

FORM = GoldenForm("burger")
STEPS = 240


def driven(noise: float = 0.0, seed: int = 0) -> Trace:
    """Ten seconds of a curve, at every physics step; `noise`: in m and rad."""
    time = np.arange(10 * STEPS + 1) / STEPS
    off = np.random.default_rng(seed).uniform(-noise, noise, (3, len(time)))
    return trace(
        time.tolist(),
        x=(np.sin(0.3 * time) + off[0]).tolist(),
        y=(0.1 * time**2 + off[1]).tolist(),
        yaw=(0.9 * time + off[2]).tolist(),
        position=(2.0 * time).tolist(),
    )


def lines(golden: Golden) -> list[str]:
    return golden.text().splitlines()


def test_a_file_is_small_and_readable() -> None:
    golden = Golden.of_trace(FORM, trace([0.0, 0.25, 0.5], x=[0.0, 1.0, 2.0], yaw=[0.0, 0.0, 1.0]), 10.0)
    assert lines(golden) == [
        "# sim-action golden trajectory 1: burger",
        "time_s,x_m,y_m,z_m,yaw_rad",
        "0.000,0.0000,0.0000,0.0000,0.0000",
        "0.100,0.4000,0.0000,0.0000,0.0000",
        "0.200,0.8000,0.0000,0.0000,0.0000",
        "0.300,1.2000,0.0000,0.0000,0.2000",
        "0.400,1.6000,0.0000,0.0000,0.6000",
        "0.500,2.0000,0.0000,0.0000,1.0000",
    ]
    assert len(Golden.of_trace(FORM, driven(), 10.0).text()) < 4_000


def test_joints_have_columns_of_their_own() -> None:
    form = GoldenForm("burger", ((WHEELS[0], "rad"),))
    golden = Golden.of_trace(form, trace([0.0, 1.0], position=[0.0, 3.0]), 2.0)
    assert lines(golden)[1].endswith(",yaw_rad,wheel_left_joint_rad")
    assert golden.rows[:, 5].tolist() == [0.0, 1.5, 3.0]


def test_what_nobody_can_see_changes_next_to_nothing() -> None:
    clean = lines(Golden.of_trace(FORM, driven(), 10.0))
    noisy = lines(Golden.of_trace(FORM, driven(1e-6), 10.0))
    assert len(clean) == len(noisy)
    changed = sum(one != other for one, other in zip(clean, noisy, strict=True))
    assert changed <= 0.1 * len(clean)


def test_zeros_have_no_sign() -> None:
    golden = Golden.of_trace(FORM, trace([0.0, 1.0], x=[-1e-7, -0.0], y=[-1e-9, 1e-9], yaw=[-1e-8, 0.0]), 1.0)
    assert "-" not in golden.text().partition("\n")[2]
    # The end is kept, between two rows.
    ended = trace([0.0, 0.1, 0.1234567], x=[0.0, 0.1, 0.1234567])
    assert Golden.of_trace(FORM, ended, 10.0).rows[-1, :2].tolist() == [0.123, 0.123]


@pytest.mark.parametrize("noise", [-1e-6, 1e-6])
def test_a_heading_at_half_a_turn_jumps_in_no_file(noise: float) -> None:
    turned = trace([0.0, 1.0, 2.0], yaw=[math.pi + noise, math.pi - noise, math.pi + 0.5])
    assert Golden.of_trace(FORM, turned, 1.0).rows[:, 4].tolist() == [3.1416, 3.1416, 3.6416]


def test_what_was_written_is_read_again(tmp_path: Path) -> None:
    golden = Golden.of_trace(FORM, driven(), 10.0)
    assert golden.write(tmp_path / "deep/down/x.csv")
    assert not golden.write(tmp_path / "deep/down/x.csv")
    np.testing.assert_array_equal(Golden.read(tmp_path / "deep/down/x.csv", FORM).rows, golden.rows)
    # Also with line ends of Windows and its mark of UTF-8.
    (tmp_path / "x.csv").write_bytes(b"\xef\xbb\xbf" + golden.text().replace("\n", "\r\n").encode())
    np.testing.assert_array_equal(Golden.read(tmp_path / "x.csv", FORM).rows, golden.rows)
    assert is_golden((tmp_path / "x.csv").read_bytes())


HEAD = "# sim-action golden trajectory 1: burger\ntime_s,x_m,y_m,z_m,yaw_rad\n"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "1: expected '# sim-action golden trajectory 1: burger', found ''"),
        ("time_s,x_m\n0,0\n", "1: expected '# sim-action golden trajectory 1: burger', found 'time_s,x_m'"),
        (HEAD.replace(" 1:", " 2:"), "1: the file has format version '2'; this sim-action reads version 1"),
        (HEAD.replace("burger", "waffle"), "1: the file belongs to the robot 'waffle'; the robot of this scenario is"),
        (HEAD.replace("yaw_rad", "yaw_deg"), "2: expected the columns time_s,x_m,y_m,z_m,yaw_rad, found 'time_s"),
        (HEAD, "3: expected a row of numbers, found the end of the file"),
        (HEAD + "0,0,0,0\n", "3: expected 5 numbers, found 4"),
        (HEAD + "0,0,0,0,0\n1,0,a,0,0\n", "4: expected 5 numbers, found '1,0,a,0,0'"),
        (HEAD + "0,0,0,0,0\n1,0,nan,0,0\n", "4: expected 5 numbers, found '1,0,nan,0,0'"),
        (HEAD + "0,0,0,0,0\n<<<<<<< HEAD\n", "4: expected 5 numbers, found 1"),
        (HEAD + "1,0,0,0,0\n1,0,0,0,0\n", "4: the time 1 s is not later than in the line before"),
        (HEAD + "\n", "3: expected 5 numbers, found 0"),
    ],
)
def test_what_is_no_such_file_is_told_with_its_line(text: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text(text)
    with pytest.raises(GoldenError, match=f"^{re.escape(told)}"):
        Golden.read(tmp_path / "x.csv", FORM)


def test_a_file_without_end_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / "x.csv").open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(GoldenError, match="larger than 20 MB"):
        Golden.read(tmp_path / "x.csv", FORM)


@given(data=st.binary(max_size=300))
def test_no_bytes_are_too_strange_to_be_refused(data: bytes, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("strange") / "x.csv"
    path.write_bytes(HEAD.encode() + data)
    told = ""
    try:
        found = len(Golden.read(path, FORM).rows)
    except GoldenError as error:
        found, told = 0, str(error)
    assert bool(found) != bool(re.match(r"\d+: ", told))


def test_between_two_rows_a_heading_turns_the_short_way() -> None:
    rows = np.array([[0.0, 0, 0, 0, 3.0], [1.0, 1, 0, 0, -3.0]])
    middle = interpolated(rows, np.array([0.5]))[0]
    assert middle[1] == 0.5
    assert abs(wrapped(middle[4:5] - math.pi)[0]) < 1e-12
