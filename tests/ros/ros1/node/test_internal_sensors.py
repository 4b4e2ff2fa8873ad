"""Sensors that measure only for subscribers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, cast

from numpy.typing import ArrayLike

from sim_action.ros.ros1.node.internal_sensors import NotMeasured, OnDemandSensor
from sim_action.sensors import Measure, Mount, Sensor, Sight


@dataclass(frozen=True)
class Since:
    """How long ago the sensor was read last."""

    time: float
    since: float

    def columns(self) -> Mapping[str, ArrayLike]:
        return {}


class Stopwatch(Sensor):
    """What it tells depends on when it was asked last, as an IMU's acceleration does."""

    key: ClassVar[str] = "stopwatch"

    def open(self, mount: Mount) -> Measure:
        last = 0.0

        def measure(sight: Sight) -> Since:
            nonlocal last
            since, last = sight.time - last, sight.time
            return Since(sight.time, since)

        return measure


def read(is_wanted: Callable[[float], bool], times: list[float], *, keeps_first: bool = False) -> list[float | None]:
    """What was told at some times; None: silence."""
    measure = OnDemandSensor.of(Stopwatch(), is_wanted, keeps_first=keeps_first).open(cast(Mount, None))
    told: list[float | None] = []
    for now in times:
        reading: Any = measure(Sight(now, cast(Any, None), cast(Any, None)))
        assert reading.time == now
        told.append(None if isinstance(reading, NotMeasured) else reading.since)
    return told


def test_a_sensor_that_is_heard_tells_all_from_the_first_moment() -> None:
    assert read(lambda _: True, [0.0, 1.0, 2.0]) == [0.0, 1.0, 1.0]


def test_a_sensor_that_nobody_hears_is_not_read() -> None:
    assert read(lambda _: False, [0.0, 1.0, 2.0]) == [None, None, None]


def test_what_was_not_heard_is_not_told_later() -> None:
    """The reading at 4 s would be about 3 s of silence."""
    assert read(lambda now: now < 2 or now >= 4, [0, 1, 2, 3, 4, 5, 6]) == [0, 1, None, None, None, 1, 1]


def test_a_reading_that_does_not_depend_on_the_one_before_is_kept_after_a_pause() -> None:
    assert read(lambda now: now in (0, 2), [0, 1, 2, 3], keeps_first=True) == [0, None, 2, None]
