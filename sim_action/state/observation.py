"""The state of the robot that controllers read at a step: pose, twist, joints, contacts and sensor readings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple, NoReturn, TypeVar, overload

from sim_action.core.geometry import Pose, Twist, Vector3
from sim_action.core.records import dataclass, field
from sim_action.core.wording import did_you_mean
from sim_action.state.readings import Reading

_Thing = TypeVar("_Thing")


class JointState(NamedTuple):
    """The state of a joint: position in rad (m if prismatic), velocity in rad/s (m/s), motor effort in N m (N)."""

    position: float
    velocity: float
    effort: float


class LinkState(NamedTuple):
    """The pose of a link, and the twist of its frame's origin; both in the world frame."""

    pose: Pose
    twist: Twist


class ByName(dict[str, _Thing]):
    """A dict of things of one kind; the error for an unknown name lists the known ones."""

    __slots__ = ()

    def __missing__(self, name: object) -> NoReturn:
        raise KeyError(f"there is no {name!r}{did_you_mean(str(name), self)}")


class Contact(NamedTuple):
    """A contact between a link of the robot and a body of the world.

    Attributes:
        time: sim time in s.
        link: name of the robot's link.
        body: name of the other body; the ground is "ground".
        position_xyz: the place in m, world frame.
        force: normal force in N at this physics step; 0 if it is not known. In an impact, it depends on `physics.rate`.
        has_force: False if neither the link nor the body can give way, so that engines compute no force between them: a
            body on a path that is inside a fixed base.
        depth: how deep the shapes overlap here, in m; 0 if they only touch.
        normal_xyz: the unit normal of the surfaces from the body to the link, world frame; 0 if it is not known. Traces
            in files do not have it.
    """

    time: float
    link: str
    body: str
    position_xyz: Vector3
    force: float
    has_force: bool = True
    depth: float = 0.0
    normal_xyz: Vector3 = (0.0, 0.0, 0.0)


class SelfContact(NamedTuple):
    """A contact between two links of the robot, or an overlap of two links that do not collide.

    Attributes:
        time: sim time in s.
        link, other: names of the two links, in the order of the model.
        position_xyz: the place in m, world frame.
        force: normal force in N at this physics step; 0 for links that are only watched and do not collide.
        depth: how deep the shapes overlap here, in m; 0 if they only touch.
    """

    time: float
    link: str
    other: str
    position_xyz: Vector3
    force: float
    depth: float = 0.0


class Overlap(NamedTuple):
    """A link of the robot that is inside a body of the world; `depth` in m, at the deepest point."""

    link: str
    body: str
    depth: float


class PresentContacts(Sequence[Contact]):
    """The contacts of the present moment, read from the engine only when they are used.

    The engine knows only the present: before the next step, it calls `settle` for all contacts still in use.
    """

    __slots__ = ("__weakref__", "_contacts", "_read")

    def __init__(self, read: Callable[[], Iterable[Contact]]) -> None:
        self._read = read
        self._contacts: tuple[Contact, ...] | None = None

    def settle(self) -> tuple[Contact, ...]:
        """Read the contacts now and keep them, so that they stay valid after the next step."""
        if self._contacts is None:
            self._contacts = tuple(self._read())
        return self._contacts

    def __len__(self) -> int:
        return len(self.settle())

    @overload
    def __getitem__(self, index: int) -> Contact: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Contact, ...]: ...
    def __getitem__(self, index: int | slice) -> Contact | tuple[Contact, ...]:
        return self.settle()[index]

    def __iter__(self) -> Iterator[Contact]:
        return iter(self.settle())

    def __eq__(self, other: object) -> bool:
        return self.settle() == (other.settle() if isinstance(other, PresentContacts) else other)

    def __hash__(self) -> int:
        return hash(self.settle())

    def __repr__(self) -> str:
        return repr(self.settle())

    def __reduce__(self) -> tuple[type[tuple[Contact, ...]], tuple[tuple[Contact, ...]]]:
        # The engine does not know of a copy, and would step on without settling it.
        return tuple, (self.settle(),)


class Clash(NamedTuple):
    """A moving body of the world that is inside another body or the ground; `depth` in m, at the deepest point."""

    body: str
    other: str
    depth: float


@dataclass(frozen=True, slots=True)
class Observation:
    """The robot at one moment.

    Attributes:
        time: sim time in s since the first command.
        pose: pose of the base link in the world frame (its link frame, not its centre of mass).
        twist: velocity of the base link's origin, world frame.
        joints: joint name -> state, for every joint that moves.
        contacts: the present contacts of the robot, with the ground included.
        sensors: sensor name -> its latest reading, for every sensor of the scenario.
        links: link name -> pose and twist of the link, computed from the base and the joints when they are read.
    """

    time: float
    pose: Pose
    twist: Twist
    joints: Mapping[str, JointState]
    contacts: Sequence[Contact] = ()
    sensors: Mapping[str, Reading] = field(default_factory=ByName)
    links: Mapping[str, LinkState] = field(default_factory=ByName)
