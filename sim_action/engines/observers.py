"""Observers that engines share: body poses for the trace, contacts that are read only when needed, and distances."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple
from weakref import ref

import numpy as np
from numpy.typing import NDArray

from sim_action.core.geometry import Vector3
from sim_action.state.observation import Contact, PresentContacts
from sim_action.state.trace_records import BodyRecord, frame_stride
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.engines.path_contacts import PathContacts

_NUMBERS: Final = 7

ReadPoses = Callable[[], Sequence[float] | NDArray[np.float64]]
"""Returns 7 numbers per body, one after the other: position and unit quaternion x, y, z, w."""


class Nearest(NamedTuple):
    """The distance of a link to a body in m, negative inside, and the nearest point of the link, world frame."""

    distance: float
    position_xyz: Vector3


NearestPoints = Callable[[str, Collection[str]], dict[str, Nearest]]
"""(body, links) -> link -> the nearest point, in the present state. Links without shapes are missing."""


def path_contacts(scene: Scene, shaped: Collection[str], nearest: NearestPoints) -> PathContacts | None:
    """Return the contacts of bodies on paths with links that cannot move; None if the scene has no such pair.

    `shaped`: the links with collision shapes.
    """
    if not any(body.path for body in scene.world.objects):
        return None
    links = sorted(scene.bolted_links.intersection(shaped))
    if not links:
        return None
    from sim_action.engines.path_contacts import PathContacts

    return PathContacts(scene, links, nearest)


class BodyRecorder:
    """Records the poses of the bodies in `Channels.bodies`, 30 times per second, without changing the run."""

    def __init__(self, names: Sequence[str], rate: float, read_poses: ReadPoses) -> None:
        self._names, self._rate, self._read_poses = names, rate, read_poses
        self._stride = frame_stride(rate)
        self._steps: list[int] = []
        self._rows: list[Sequence[float] | NDArray[np.float64]] = []

    @property
    def is_idle(self) -> bool:
        """Return True if no body is to be recorded."""
        return not self._names

    def record(self, step: int) -> None:
        """Record the present poses as those of a step if a sample is due; the first step is always recorded."""
        if step > 0 and (step % self._stride == 0 or step == 1):
            self._steps.append(step)
            self._rows.append(self._read_poses())

    def collect(self) -> dict[str, BodyRecord]:
        """Return the records since the last call, by body name."""
        if not self._steps:
            return {}
        time = np.array(self._steps, dtype=np.float64) / self._rate
        rows = np.array(self._rows, dtype=np.float64).reshape(len(time), len(self._names), _NUMBERS)
        self._steps, self._rows = [], []
        return {
            name: BodyRecord(time, rows[:, place, :3], rows[:, place, 3:]) for place, name in enumerate(self._names)
        }


class LazyContacts:
    """The contacts of the latest observation, which are read when somebody accesses them or before the next step.

    Most controllers never access them and drop an observation before the next one: then they are never read.
    """

    def __init__(self) -> None:
        self._last: ref[PresentContacts] | None = None

    def present(self, read: Callable[[], Iterable[Contact]]) -> PresentContacts:
        """Return the present contacts; `read` is called only when they are accessed."""
        self.settle()
        present = PresentContacts(read)
        self._last = ref(present)
        return present

    def settle(self) -> None:
        """Read the contacts before the engine steps, if an observation that holds them is still alive."""
        if self._last is not None:
            held = self._last()
            if held is not None:
                held.settle()
            self._last = None
