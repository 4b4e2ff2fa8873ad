"""Readings over time, as columns."""

from __future__ import annotations

from sim_action.state.readings import ContactReading
from sim_action.state.sensor_record import SensorRecord

READINGS = [ContactReading(time, time > 0.1, 10 * time, ("wall",)) for time in (0.0, 0.1, 0.2, 0.3)]


def test_readings_become_columns_at_their_own_times() -> None:
    record = SensorRecord.of_readings("contact", READINGS)
    assert len(record) == 4
    assert record.time.tolist() == [0.0, 0.1, 0.2, 0.3]
    assert record.columns["touching"].tolist() == [0, 0, 1, 1]
    assert record.columns["force"].tolist() == [0.0, 1.0, 2.0, 3.0]


def test_a_record_in_pieces_is_the_record() -> None:
    record = SensorRecord.of_readings("contact", READINGS)
    pieces = record.between(-1, 0.15), record.between(0.15, 0.17), record.between(0.2, 0.3)
    assert [len(piece) for piece in pieces] == [2, 0, 2]
    joined = SensorRecord.concatenate(pieces)
    assert joined.time.tolist() == record.time.tolist()
    assert joined.columns["force"].tolist() == record.columns["force"].tolist()
