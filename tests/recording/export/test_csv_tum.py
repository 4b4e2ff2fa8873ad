"""CSV, read back as a spreadsheet would."""

from __future__ import annotations

import csv
import io
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from sim_action.assertions.upright import Upright
from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist
from sim_action.recording.export.csv_tum import CsvTable, TumTrajectory
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.robot.model.kinematics import link_poses
from sim_action.state.trace_records import CommandedTwists
from tests.recording.export.runs import MOMENTS, TIME, appearing, rolling, run, sensing_run, with_bodies
from tests.traces import expectation, scenario, trace


def written(made: RecordedRun) -> tuple[list[str], list[list[float]]]:
    file = io.BytesIO()
    CsvTable.write(made, file)
    header, *rows = csv.reader(io.StringIO(file.getvalue().decode(), newline=""), strict=True)
    return header, [list(map(float, row)) for row in rows]


def test_every_column_has_its_unit_and_its_numbers() -> None:
    header, rows = written(run())
    table = dict(zip(header, zip(*rows, strict=True), strict=True))
    assert table["time [s]"] == pytest.approx(TIME)
    assert table["x [m]"] == pytest.approx(TIME)
    assert table["y [m]"] == (0.25,) * len(TIME)
    assert table["yaw [rad]"] == pytest.approx([2 * time for time in TIME])
    assert table["qw"] == pytest.approx([np.cos(time) for time in TIME])
    assert table["vx [m/s]"] == (1.0,) * len(TIME)
    assert table["wz [rad/s]"] == (2.0,) * len(TIME)
    assert table["position of wheel_left_joint [rad]"] == pytest.approx([-3 * time for time in TIME])
    assert table["velocity of wheel_left_joint [rad/s]"] == (-3.0,) * len(TIME)
    assert table["effort of wheel_right_joint [N m]"] == (0.0,) * len(TIME)
    assert table["y of ball [m]"] == pytest.approx(TIME)
    assert table["qw of ball"] == (1.0,) * len(TIME)
    assert len(header) == len(set(header)) == 17 + 2 * 3 + 7


def test_no_zero_has_a_sign_and_no_name_begins_a_formula() -> None:
    made = run()
    file = io.BytesIO()
    named = with_bodies(made, **{'=HYPERLINK("x"),\n': rolling()})
    CsvTable.write(named, file)
    text = file.getvalue().decode()
    assert "-0," not in text
    header, rows = written(named)
    assert not any(name.startswith(("=", "+", "-", "@")) for name in header)
    assert len(rows) == len(TIME)


def test_a_body_has_empty_cells_until_it_appears() -> None:
    file = io.BytesIO()
    CsvTable.write(appearing(TIME[5]), file)
    rows = list(csv.DictReader(io.StringIO(file.getvalue().decode(), newline=""), strict=True))
    assert [row["z of ball [m]"] for row in rows] == [""] * 5 + ["0.1"] * (MOMENTS - 5)
    assert [row["x of wall [m]"] for row in rows] == [""] * 5 + ["2"] * (MOMENTS - 5)
    assert all(row["x [m]"] for row in rows)


def test_chosen_links_have_columns_of_their_own() -> None:
    made = replace(run(), links=("base_scan", "wheel_left_link"))
    header, rows = written(made)
    table = dict(zip(header, zip(*rows, strict=True), strict=True))
    assert len(header) == len(set(header)) == 17 + 2 * 3 + 7 + 2 * 16
    scan = [geometry.compose(base, link_poses(made.scene.model, {})["base_scan"]) for base in bases()]
    assert table["x of base_scan [m]"] == pytest.approx([pose.position_xyz[0] for pose in scan])
    assert table["qz of base_scan"] == pytest.approx([pose.orientation_xyzw[2] for pose in scan])
    assert table["yaw of base_scan [rad]"] == pytest.approx([2 * time for time in TIME])
    # The base moves at 1 m/s along x, and turns at 2 rad/s about itself.
    away = [(pose.position_xyz[1] - 0.25) for pose in scan]
    assert table["vx of base_scan [m/s]"] == pytest.approx([1.0 - 2 * y for y in away])
    assert table["wz of base_scan [rad/s]"] == pytest.approx([2.0] * MOMENTS)
    axis = [(-3 * -math.sin(2 * time), -3 * math.cos(2 * time)) for time in TIME]
    turning = list(zip(table["wx of wheel_left_link [rad/s]"], table["wy of wheel_left_link [rad/s]"], strict=True))
    assert np.array(turning) == pytest.approx(np.array(axis))


def bases() -> list[Pose]:
    """The poses of the base in `run`."""
    return [Pose((time, 0.25, 0.0), geometry.quaternion_from_rpy(0.0, 0.0, 2 * time)) for time in TIME]


def test_trajectories_of_tum() -> None:
    # The first chosen link is the one of tum.
    made, file = replace(run(), links=("base_scan", "wheel_left_link")), io.BytesIO()
    TumTrajectory.write(made, file)
    table = np.loadtxt(file.getvalue().decode("ascii").splitlines())
    scan = [geometry.compose(base, link_poses(made.scene.model, {})["base_scan"]) for base in bases()]
    np.testing.assert_allclose(table[:, 1:4], [pose.position_xyz for pose in scan], atol=1e-9)
    # It is the way of the base.
    made, file = run(), io.BytesIO()
    TumTrajectory.write(made, file)
    comment, *lines = file.getvalue().decode("ascii").splitlines()
    assert comment == "# timestamp tx ty tz qx qy qz qw"
    assert all(re.fullmatch(r"-?\d+\.\d+( -?\d+\.\d+){7}", line) for line in lines)
    table = np.loadtxt(lines)
    assert table.shape == (len(TIME), 8)
    np.testing.assert_allclose(table[:, 0], made.trace.time, atol=1e-6)
    np.testing.assert_allclose(table[:, 1:4], made.trace.base_position_xyz, atol=1e-9)
    np.testing.assert_allclose(table[:, 4:], made.trace.base_orientation_xyzw, atol=1e-9)
    assert "-0.000000000" not in file.getvalue().decode()


@pytest.mark.parametrize(("stored", "moments"), [([0.0, 0.5], MOMENTS), ([step / 60 for step in range(31)], 31)])
def test_whichever_has_more_moments_is_recorded_with_all_that_is_known(stored: list[float], moments: int) -> None:
    film, readings = run().trace, sensing_run().trace.sensors
    kept = replace(trace(stored), sensors=readings)
    made = RecordedRun.of(run().scene, film, kept, scenario(expectation(Upright())), CommandedTwists())
    assert len(made.trace) == moments
    assert made.trace.contacts == film.contacts
    assert made.trace.sensors == readings
    assert made.bodies["ball"].shape == (moments, 7)


def test_bodies_and_twists_are_those_of_each_moment() -> None:
    # A body is where it was seen last.
    made, ball = run(), rolling()
    seen = ball.rows(np.array([3, 8]))
    tracks = replace(made, trace=replace(made.trace, bodies={"ball": seen})).bodies
    expected = [TIME[3]] * 8 + [TIME[8]] * (MOMENTS - 8)
    assert tracks["ball"][:, 1].tolist() == expected
    # A body is nowhere until it appears.
    made = appearing(TIME[5])
    assert list(made.bodies) == ["ball", "wall"]
    for poses in made.bodies.values():
        assert np.isnan(poses[:5]).all()
    assert made.bodies["ball"][5:, 1].tolist() == TIME[5:]
    assert made.bodies["wall"][5:, 0].tolist() == [2.0] * (MOMENTS - 5)
    # Twists are kept as they were told.
    told = CommandedTwists.of([(0.0, Twist.planar(1.0, 2.0)), (0.5, Twist.planar(lateral=3.0))])
    assert told.time.tolist() == [0.0, 0.5]
    assert told.values.tolist() == [[1.0, 0, 0, 0, 0, 2.0], [0, 3.0, 0, 0, 0, 0]]
    assert len(CommandedTwists.of([])) == len(CommandedTwists()) == 0
    assert CommandedTwists.of([]).values.shape == (0, 6)
