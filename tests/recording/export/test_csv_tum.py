"""CSV, read back as a spreadsheet would."""

from __future__ import annotations

import csv
import io
import re

import numpy as np
import pytest

from sim_action.recording.export.csv_tum import CsvTable, TumTrajectory
from sim_action.recording.export.recorded_run import RecordedRun
from tests.recording.export.runs import MOMENTS, TIME, appearing, rolling, run, with_bodies


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


def test_it_is_the_way_of_the_base() -> None:
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
