"""Observers that engines share: body poses for the trace, contacts that are read only when needed, and distances.

Between bodies on paths and links that cannot move, neither of the two gives way, so engines compute no contact between
them. Such a pair is judged by its distance: it touches at each step at which its shapes overlap. After a query the pair
is measured again only when the body can have come near enough, at the greatest speed of its path.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import Any, Final, NamedTuple, TypeVar
from weakref import ref

import numpy as np
from numpy.typing import NDArray

from sim_action.core.geometry import Vector3
from sim_action.core.units import first_step
from sim_action.robot.model.joint_selection import matches_name
from sim_action.state.observation import Clash, Contact, Overlap, PresentContacts
from sim_action.state.trace_records import ALWAYS, BodyRecord, Channels, ContactRecord, LinkTouch, frame_stride
from sim_action.world import Body, World, path_of
from sim_action.world.parts import reach
from sim_action.world.scene import Scene

_NUMBERS: Final = 7
ReadPoses = Callable[[], Sequence[float] | NDArray[np.float64]]
"""Returns 7 numbers per body, one after the other: position and unit quaternion x, y, z, w."""

PoseReader = Callable[[Sequence[str]], ReadPoses]
"""Returns the function that reads the poses of these bodies of the world."""


class Nearest(NamedTuple):
    """The distance of a link to a body in m, negative inside, and the nearest point of the link, world frame."""

    distance: float
    position_xyz: Vector3


NearestPoints = Callable[[str, Collection[str]], dict[str, Nearest]]
"""(body, links) -> link -> the nearest point, in the present state. Links without shapes are missing."""


AnyTouch = TypeVar("AnyTouch", Overlap, Clash)


def deepest(touches: Iterable[AnyTouch]) -> tuple[AnyTouch, ...]:
    """Return the deepest touch of each pair of names that overlaps."""
    kept: dict[tuple[str, str], AnyTouch] = {}
    for touch in touches:
        first, second, depth = touch
        if depth > (kept[first, second].depth if (first, second) in kept else 0.0):
            kept[first, second] = touch
    return tuple(kept.values())


def path_contacts(scene: Scene, shaped: Collection[str], nearest: NearestPoints) -> PathContacts | None:
    """Return the contacts of bodies on paths with links that cannot move, of the links `shaped`; None without any."""
    if not any(body.path for body in scene.world.objects):
        return None
    links = sorted(scene.bolted_links.intersection(shaped))
    return PathContacts(scene, links, nearest) if links else None


def presences(world: World, rate: float) -> dict[str, tuple[float, float]]:
    """Return the sim times in s between which a body is there, for bodies that appear or disappear."""
    bodies = (body for body in world.objects if body.appears or body.disappears)
    return {body.name: (first / rate, gone / rate) for body in bodies for first, gone in [body.presence(rate)]}


class BodyRecorder:
    """Records the poses of bodies of the world, without changing the run."""

    def __init__(self, names: Collection[str], scene: Scene, reader: PoseReader, stride: int) -> None:
        """Prepare the record of these bodies at every `stride`-th step; at every step, absent bodies are NaN."""
        self._rate, self._stride = scene.physics.rate, stride
        self._names = [body.name for body in scene.world.objects if body.name in names]
        self._read_poses = reader(self._names)
        self._presences = presences(scene.world, self._rate) if stride == 1 else {}
        self._steps: list[int] = []
        self._rows: list[Sequence[float] | NDArray[np.float64]] = []

    @property
    def is_idle(self) -> bool:
        """Return True if no body is to be recorded."""
        return not self._names

    def record(self, step: int) -> None:
        """Record the present poses as poses of a step if a sample is due; the first step is always recorded."""
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
        records = ((name, BodyRecord(time, rows[:, i, :3], rows[:, i, 3:])) for i, name in enumerate(self._names))
        return {name: record.within(*self._presences.get(name, ALWAYS)) for name, record in records}

    def follow(self, world: World) -> None:
        """Take the times at which bodies of a world appear and disappear."""
        if self._presences:
            self._presences = presences(world, self._rate)


class ContactRecorder:
    """Records the contacts of the links in `Channels.link_contacts` after each step."""

    def __init__(self, links: Collection[str], rate: float, read: Callable[[], Iterable[LinkTouch]]) -> None:
        """Prepare the record; `read` returns the present contacts of all links."""
        self._rate, self._read = rate, read
        self._touches: dict[str, list[tuple[float, LinkTouch]]] = {link: [] for link in sorted(links)}

    @property
    def is_idle(self) -> bool:
        """Return True if the contacts of no link are to be recorded."""
        return not self._touches

    def record(self, step: int) -> None:
        """Record the present contacts as contacts of a step."""
        time = step / self._rate
        for touch in self._read():
            if touch.link in self._touches:
                self._touches[touch.link].append((time, touch))

    def collect(self) -> dict[str, ContactRecord]:
        """Return the records since the last call, by link."""
        contacts, self._touches = self._touches, {link: [] for link in self._touches}
        return {link: ContactRecord.of(touches) for link, touches in contacts.items()}


class Recorders:
    """Records the bodies, objects and contacts of links for a trace, as far as they are requested."""

    def __init__(
        self, channels: Channels, scene: Scene, reader: PoseReader, contacts: Callable[[], Iterable[LinkTouch]]
    ) -> None:
        """Prepare the records; `contacts` returns the present contacts of all links."""
        rate = scene.physics.rate
        self._bodies = BodyRecorder(channels.bodies, scene, reader, frame_stride(rate))
        self._objects = BodyRecorder(channels.objects, scene, reader, 1)
        names = channels.link_contacts
        links = [link.name for link in scene.model.links if any(matches_name(name, link.name) for name in names)]
        self._contacts = ContactRecorder(links, rate, contacts)

    def follow(self, world: World) -> None:
        """Take the times at which bodies of a world appear and disappear."""
        self._objects.follow(world)

    @property
    def watchers(self) -> list[Callable[[int], None]]:
        """The functions to call after each step, with its number."""
        recorders = (self._bodies, self._objects, self._contacts)
        return [recorder.record for recorder in recorders if not recorder.is_idle]

    def collect(self) -> dict[str, Any]:
        """Return the records since the last call, by the attribute of `Trace`."""
        objects = self._objects.collect()
        contacts = self._contacts.collect()
        return {"bodies": self._bodies.collect(), "objects": objects, "link_contacts": contacts}

    def present_contacts(self, step: int) -> dict[str, ContactRecord]:
        """Return the present contacts of the requested links, as contacts of step `step`."""
        self._contacts.record(step)
        return self._contacts.collect()


class LazyContacts:
    """The contacts of the latest observation, read when accessed, or before the next step while it is kept."""

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


MIN_OVERLAP_M: Final = 1e-4  # shapes that overlap by less do not touch: a body may slide along a fixed link

# The used share of a distance, and m. The rest covers rounding errors.
_SHARE: Final = 0.9
_PRECISION_M: Final = 1e-3


_NEVER: Final = 10**15  # the step at which a body is due that never moves again


class _Traveller:
    """A body on a path. `due`: the first step at which it can touch a link."""

    def __init__(self, scene: Scene, body: Body) -> None:
        parts = scene.parts_of(body)
        path = path_of(body, parts)
        fastest, _ = path.fastest(max(map(reach, parts)))
        self.name, self.due = body.name, 0
        self._way = fastest / scene.physics.rate
        self._end = _NEVER if body.loop or body.pace else first_step(path.times[-1], scene.physics.rate)

    def update_due(self, step: int, distance: float) -> None:
        """Set `due` after a query at a step with the distance to the nearest link, in m."""
        free = _SHARE * distance - _PRECISION_M
        if free < 0:
            self.due = step + 1
        elif self._way == 0 or step >= self._end:
            self.due = _NEVER
        else:
            self.due = step + max(1, int(min(free / self._way, _NEVER)))


class PathContacts:
    """The contacts of bodies on paths with the links that cannot move. Steps must not go back."""

    def __init__(self, scene: Scene, links: Sequence[str], nearest: NearestPoints) -> None:
        self._rate, self._links, self._nearest = scene.physics.rate, links, nearest
        self._travellers = [_Traveller(scene, body) for body in scene.world.objects if body.path]
        self._due = 0
        self._measured, self._contacts = -1, list[Contact]()

    def at(self, step: int) -> Sequence[Contact]:
        """Return the contacts at the present step; before t = 0 bodies wait at their start."""
        moment = max(step, 0)
        if moment >= self._due and moment != self._measured:
            self._measured, self._contacts = moment, []
            for body in self._travellers:
                if moment < body.due:
                    continue
                nearest = self._nearest(body.name, self._links)
                for link, (distance, place) in sorted(nearest.items()):
                    if distance < -MIN_OVERLAP_M:
                        time = moment / self._rate
                        contact = Contact(time, link, body.name, place, 0.0, has_force=False, depth=-distance)
                        self._contacts.append(contact)
                body.update_due(moment, min((near.distance for near in nearest.values()), default=math.inf))
            self._due = min(body.due for body in self._travellers)
        return self._contacts if moment == self._measured else ()
