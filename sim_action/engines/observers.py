"""Where bodies of the world are, 30 times a second, for those that a trace keeps."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Final
from weakref import ref

import numpy as np
from numpy.typing import NDArray

from sim_action.state.observation import Contact, PresentContacts
from sim_action.state.trace_records import BodyRecord, frame_stride

_NUMBERS: Final = 7

Look = Callable[[], Sequence[float] | NDArray[np.float64]]
"""Asks the engine where these bodies are: position and unit quaternion x, y, z, w of each, one after the other."""


class BodyTracks:
    """The live half of `Channels.bodies`; looking changes nothing that the engine does."""

    def __init__(self, names: Sequence[str], rate: float, look: Look) -> None:
        self._names, self._rate, self._look = names, rate, look
        self._stride = frame_stride(rate)
        self._steps: list[int] = []
        self._rows: list[Sequence[float] | NDArray[np.float64]] = []

    @property
    def is_idle(self) -> bool:
        """Whether there is none that anybody asks for."""
        return not self._names

    def see(self, step: int) -> None:
        """Writes down the present, as that of a step, if it is time; and where everything begins."""
        if step > 0 and (step % self._stride == 0 or step == 1):
            self._steps.append(step)
            self._rows.append(self._look())

    def collect(self) -> dict[str, BodyRecord]:
        """What was seen since the last call, by the bodies' names."""
        if not self._steps:
            return {}
        time = np.array(self._steps, dtype=np.float64) / self._rate
        rows = np.array(self._rows, dtype=np.float64).reshape(len(time), len(self._names), _NUMBERS)
        self._steps, self._rows = [], []
        return {
            name: BodyRecord(time, rows[:, place, :3], rows[:, place, 3:]) for place, name in enumerate(self._names)
        }


class Glance:
    """Most controllers do not look at contacts, and most let go of an observation before the next one."""

    def __init__(self) -> None:
        self._last: ref[PresentContacts] | None = None

    def at(self, read: Callable[[], Iterable[Contact]]) -> PresentContacts:
        """Contacts of the present, which `read` would read now."""
        self.settle()
        present = PresentContacts(read)
        self._last = ref(present)
        return present

    def settle(self) -> None:
        """Before the engine goes on: whoever still holds them, and has not looked, is to see what they are now."""
        if self._last is not None:
            held = self._last()
            if held is not None:
                held.settle()
            self._last = None
