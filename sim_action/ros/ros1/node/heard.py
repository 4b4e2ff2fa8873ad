"""Sensors that are read while a node listens: on a robot of many, most are heard by nobody."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

from numpy.typing import ArrayLike
from pydantic import PrivateAttr

from sim_action.sensors import Measure, Mount, Sensor, Sight
from sim_action.state.readings import Reading


@dataclass(frozen=True, slots=True)
class Silence:
    """In place of a reading that nobody has asked for; `time`: s of sim time."""

    time: float

    def columns(self) -> Mapping[str, ArrayLike]:
        """See Reading.columns: no trace keeps it."""
        return {}


class HeardSensor(Sensor):
    """Another sensor, and silence when nobody listens. No key of a scenario leads here."""

    key: ClassVar[str] = "heard"

    _inner: Sensor = PrivateAttr()
    _is_heard: Callable[[], bool] = PrivateAttr()

    @classmethod
    def of(cls, inner: Sensor, is_heard: Callable[[], bool]) -> HeardSensor:
        """`is_heard`: whether it is to be read; asked at each of its ticks."""
        sensor = cls()
        sensor._inner, sensor._is_heard = inner, is_heard
        return sensor

    def open(self, mount: Mount) -> Measure:
        """See Sensor.open. The first reading after a silence is left out: it may be of all that was since the last."""
        measure = self._inner.open(mount)
        is_fresh = True

        def heard(sight: Sight) -> Reading:
            nonlocal is_fresh
            was_fresh, is_fresh = is_fresh, self._is_heard()
            reading = measure(sight) if is_fresh else Silence(sight.time)
            return reading if was_fresh else Silence(sight.time)

        return heard
