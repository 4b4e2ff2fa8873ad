"""CSV, read back as a spreadsheet would."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest

from sim_action.recording.export.csv_table import CsvTable
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
