"""What a controller sees at a control step: sim time, ground truth of the base, joints, contacts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from sim_action.geometry import Pose, Twist, Vector3
from sim_action.readings import Reading


class JointState(NamedTuple):
    """One joint: position in rad (m if prismatic), velocity in rad/s (m/s), motor effort in N m (N)."""

    position: float
    velocity: float
    effort: float


class Contact(NamedTuple):
    """A link of the robot touching a body of the world.

    Attributes:
        time: sim time in s.
        link: name of the robot's link.
        body: name of the other body; the ground is "ground".
        position_xyz: where, in m, world frame.
        force: normal force in N.
    """

    time: float
    link: str
    body: str
    position_xyz: Vector3
    force: float


class Overlap(NamedTuple):
    """A link of the robot inside a body of the world: how deep in m, where it is deepest."""

    link: str
    body: str
    depth: float


@dataclass(frozen=True, slots=True)
class Observation:
    """The robot at one moment.

    Attributes:
        time: sim time in s since the first command.
        pose: base link in the world frame (its link frame, not its centre of mass).
        twist: velocity of the base link's origin, world frame.
        joints: joint name -> state, for every joint that moves.
        contacts: what touches the robot now, the ground included.
        sensors: name -> its latest reading, for every sensor of the scenario.
    """

    time: float
    pose: Pose
    twist: Twist
    joints: Mapping[str, JointState]
    contacts: tuple[Contact, ...] = ()
    sensors: Mapping[str, Reading] = field(default_factory=dict)
