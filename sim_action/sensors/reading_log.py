"""The readings of a sensor that a replay keeps, at a limited rate and size."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from sim_action.core.records import dataclass, field
from sim_action.state.readings import Reading
from sim_action.state.trace_records import FRAME_RATE

if TYPE_CHECKING:
    from sim_action.sensors import MountedSensor

_PICTURE_RATE: Final = 2.0
_MAX_BYTES: Final = 32_000_000
_SMALL_READING_BYTES: Final = 500  # the size of a reading without arrays, for example that of an IMU


@dataclass(slots=True)
class ReadingLog:
    """The readings of one sensor: at most 30 per second, 2 of a camera, and fewer in long runs."""

    mounted: MountedSensor
    every: int = 1  # one of so many readings is kept
    readings: list[Reading] = field(default_factory=list)  # the kept readings, in the order of time
    _seen: int = 0

    @classmethod
    def of(cls, mounted: MountedSensor) -> ReadingLog:
        """Return the empty log of a sensor."""
        most = _PICTURE_RATE if mounted.sensor.is_picture else FRAME_RATE
        return cls(mounted, max(1, math.ceil(mounted.rate / most - 1e-9)))

    def add(self, reading: Reading) -> None:
        """Add the next reading, unless it is one of those that are left out."""
        if self._seen % self.every == 0:
            self.readings.append(reading)
            if len(self.readings) * max(_SMALL_READING_BYTES, self.mounted.sensor.reading_bytes) > _MAX_BYTES:
                # The first reading and every second one after it stay.
                del self.readings[1::2]
                self.every *= 2
        self._seen += 1
