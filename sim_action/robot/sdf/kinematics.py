"""Where the links of an SDF are as URDF sees them, and what holds them together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from sim_action.core import geometry
from sim_action.core.geometry import ZERO, Pose
from sim_action.robot.robot_model import WORLD
from sim_action.robot.sdf.frames import Frames
from sim_action.robot.sdf.hinges import Hinge, hinge_of
from sim_action.robot.sdf.problems import Notes
from sim_action.robot.sdf.scopes import Entry, Scope


@dataclass(frozen=True)
class Kinematics:
    """The tree, if it is one.

    Attributes:
        placed: link -> its frame in URDF, in the outermost model's frame.
        in_world: the outermost model's frame, in the world.
        bolted: static links, which hang on the world by no joint of the file's.
        free: links that hang on nothing; a robot has one.
    """

    placed: Mapping[Entry, Pose]
    hinges: tuple[Hinge, ...]
    in_world: Pose
    bolted: tuple[Entry, ...]
    free: tuple[Entry, ...]

    @property
    def needs_world(self) -> bool:
        """Whether something hangs on the world."""
        return bool(self.bolted) or any(hinge.parent is None for hinge in self.hinges)

    def seen_from(self, parent: Entry | None, child: Entry) -> Pose:
        """The frame of a link in that of another, or in the world."""
        outer = self.in_world if parent is None else geometry.inverse(self.placed[parent])
        return geometry.compose(outer, self.placed[child])


def kinematics_of(scope: Scope, frames: Frames, notes: Notes) -> Kinematics:
    """Looks up all frames and joints; what is wrong is noted."""
    in_world = notes.attempt(Frames.root_in_world, frames) or Pose()
    for entry in (*scope.all_of("frame"), *scope.all_of("model")):
        notes.attempt(frames.check, entry)
    found = [notes.attempt(lambda entry: hinge_of(notes, frames, entry), joint) for joint in scope.all_of("joint")]
    hinges = tuple(hinge for hinge in found if hinge)
    carriers = {hinge.child: hinge for hinge in reversed(hinges)}
    links = tuple(scope.all_of("link"))
    poses = [notes.attempt(lambda link: _placed(frames, link, carriers.get(link)), link) for link in links]
    loose = [link for link in links if link not in carriers]
    bolted = dict.fromkeys(link for link in loose if link.owner.static and link.full_name != WORLD)
    placed = {link: pose for link, pose in zip(links, poses, strict=True) if pose}
    return Kinematics(placed, hinges, in_world, tuple(bolted), tuple(link for link in loose if link not in bolted))


def _placed(frames: Frames, link: Entry, carrier: Hinge | None) -> Pose:
    pose = frames.in_root(link)
    return geometry.compose(pose, Pose(carrier.shift(pose) if carrier else ZERO))
