"""Bounds on the motion of links and bodies in a step: which of them are fast enough to pass through each other.

The speeds of each block of steps give an upper bound on the motion of each link and body in a step. Only if it exceeds
the widths of the link or body and an obstacle together, `swept_search` looks at each step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from sim_action.core.lazy_numpy import FloatArray
from sim_action.engines.clearances import motion_factors
from sim_action.robot.model.robot_model import Shape
from sim_action.state.trace import Trace
from sim_action.world import MAX_SPEED, Body, path_of
from sim_action.world.body import PosePath
from sim_action.world.parts import BoxPart, CylinderPart, Part, SpherePart, reach
from sim_action.world.scene import Scene

FIXED: Final = -1  # the number of the obstacle that is all fixed bodies
_HULL_SHARE: Final = 0.1  # a mesh is several hulls, each thinner than the mesh, and its bounding box may be skew


class Miss(NamedTuple):
    """A piece that passed through another."""

    row: int  # the index of the step in its block
    mover: str  # the moved piece's link or body, as in messages
    body: str  # the other piece's link or body, as in messages
    way: float  # the motion in the step in m, relative to the other piece
    extent: float  # of the piece along the way, in m
    thickness: float  # of the other piece, in m
    is_late: bool = False  # True if the engine saw a contact at the end of the step or before it


class Mover(NamedTuple):
    """A body that can move: it has a mass or a path."""

    body: Body
    width: float  # a lower bound in m on the width of its pieces
    reach: float  # an upper bound in m on the distance of its surface from its origin
    path: PosePath | None = None  # its path; None for a body with a mass
    # fastest, turns: upper bounds in m/s and rad/s on the speed of any of its points and its turn rate on the path
    fastest: float = 0.0
    turns: float = 0.0

    @classmethod
    def of(cls, body: Body, parts: Sequence[Part]) -> Mover:
        """Return a body with these parts."""
        width = _least_thickness(parts)
        far = max(map(reach, parts))
        if not body.path:
            return cls(body, width, far)
        path = path_of(body, parts)
        fastest, turns = path.fastest(far)
        return cls(body, width, far, path, fastest, turns)


class Parts:
    """Everything that can pass through something: first the links with shapes, then the movers.

    Attributes:
        links: the names of the L links.
        turns: (L, 2 + J) as in `MotionFactors`.
        fixed: the bodies without a mass or a path.
        movers: the others; the `heavy` ones, with a mass, come first.
    """

    def __init__(self, scene: Scene, *, solid_terrain: bool, links_only: bool = False) -> None:
        """Measure all parts; `links_only`: pairs of bodies are left to the watch of another robot."""
        self.scene, self.solid_terrain, self._links_only = scene, solid_terrain, links_only
        links = [link for link in scene.model.links if link.collisions]
        factors = motion_factors(scene.model, {link.name: max(map(_shape_reach, link.collisions)) for link in links})
        columns, bolted = 2 + len(scene.model.moving_joints), scene.bolted_links
        self.links = tuple(link.name for link in links)
        self.turns = np.array([factors[name].turns for name in self.links]).reshape(-1, columns)
        self._ways = np.array([factors[name].ways for name in self.links]).reshape(-1, columns)
        self._widths = np.array([min(map(_least_width, link.collisions)) for link in links], dtype=np.float64)
        # Fixed links do not touch fixed bodies.
        self._free = np.array([link.name not in bolted for link in links], dtype=np.bool_)
        bodies = scene.world.objects
        self.fixed = tuple(body for body in bodies if body.mass is None and not body.path)
        heavy = [body for body in bodies if body.mass is not None]
        moving = (*heavy, *(body for body in bodies if body.path))
        self.movers = tuple(Mover.of(body, scene.parts_of(body)) for body in moving)
        self.heavy = len(heavy)
        self._thickness = min((_least_thickness(scene.parts_of(body)) for body in self.fixed), default=math.inf)
        self._mover_widths = np.array([mover.width for mover in self.movers], dtype=np.float64)
        self._paths = np.array([mover.fastest for mover in self.movers]) / scene.physics.rate
        self._reaches = np.array([mover.reach for mover in self.movers[: self.heavy]])

    def calm_state(self) -> FloatArray:
        """Return bounds (6 + 2 J,) on velocities in `Trace.state` within which nothing is fast; see `fast_pairs`."""
        joints = self._ways.shape[1] - 2
        ways = self._paths - self._mover_widths
        # A link that meets links of other robots may not move by more than its own width.
        least = 0.0 if self.scene.actors else -math.inf
        obstacles = (np.append(ways, -self._thickness if free else -math.inf) for free in self._free)
        widest = np.array([margins.max(initial=least) for margins in obstacles])
        budgets = (self._widths - widest) * self.scene.physics.rate
        if self.heavy or (budgets <= 0).any():
            return np.full(6 + 2 * joints, -1.0)
        with np.errstate(divide="ignore"):
            most = (budgets[:, None] / self._ways).min(axis=0, initial=math.inf)
        # The speed, the turn rate and all joints together get a third of each budget.
        third, per_joint = math.sqrt(3) * 3, 3 * max(joints, 1)
        return np.concatenate(([most[0] / third] * 3, [most[1] / third] * 3, [math.inf] * joints, most[2:] / per_joint))

    def fast_pairs(self, block: Block) -> list[tuple[int, int]]:
        """Return the pairs of a part and an obstacle, `FIXED` or a mover, that may pass through each other."""
        spare = self.spare(block.trace)
        pairs = [(link, FIXED) for link in np.flatnonzero((spare < -self._thickness) & self._free).tolist()]
        if not self.movers:
            return pairs
        first = len(self.links)
        # Upper bounds (M,) in m on the motion of any point of each mover in a step.
        ways = self._paths
        if self.heavy:
            ways = ways.copy()
            moved = block.moved + block.turned * self._reaches
            ways[: self.heavy] = np.where(block.moved > MAX_SPEED / self.scene.physics.rate, 0.0, moved).max(axis=0)
        spares = self._mover_widths - ways
        heavy = spares[: self.heavy]
        if not self._links_only:
            pairs += [(first + mover, FIXED) for mover in np.flatnonzero(heavy < -self._thickness).tolist()]
        for number in range(len(self.movers)):
            pairs += [(link, number) for link in np.flatnonzero(spare < -spares[number]).tolist()]
            if self._links_only:
                continue
            pairs += [(first + other, number) for other in np.flatnonzero(heavy[:number] < -spares[number]).tolist()]
        return pairs

    def spare(self, trace: Trace) -> FloatArray:
        """Return (L,) m, the width of links minus motion in a step; below 0 in sum, one may pass through another."""
        peaks = np.abs(trace.state[:, 8:]).max(axis=0).tolist()
        joints = (len(peaks) - 6) // 3
        speeds = (math.hypot(*peaks[:3]), math.hypot(*peaks[3:6]), *peaks[6 + joints : 6 + 2 * joints])
        return np.asarray(self._widths - self._ways @ speeds / self.scene.physics.rate, dtype=np.float64)


class Block:
    """A block of T steps.

    Attributes:
        before: the row of `Trace.state` before the first step.
        poses: (T + 1, M, 7) of the bodies with a mass, from that moment on.
        moved, turned: (T, M) m and rad, their motion in each step.
    """

    def __init__(self, before: FloatArray, trace: Trace, poses: FloatArray) -> None:
        self.before, self.trace, self.poses = before, trace, poses
        if poses.shape[1]:
            self.moved = np.sqrt(np.square(np.diff(poses[:, :, :3], axis=0)).sum(axis=2))
            alike = np.abs((poses[1:, :, 3:] * poses[:-1, :, 3:]).sum(axis=2))
            self.turned = 2 * np.arccos(np.minimum(alike, 1.0))


def _least_width(shape: Shape) -> float:
    extents = np.subtract(shape.upper_xyz, shape.lower_xyz)
    return float(extents.min()) * (_HULL_SHARE if shape.kind == "mesh" else 1.0)


def _least_thickness(parts: Sequence[Part]) -> float:
    """Return a lower bound in m on the thickness of the parts of a body, cheap enough for every run."""
    least = math.inf
    for part in parts:
        if isinstance(part, BoxPart):
            least = min(least, *part.size_xyz)
        elif isinstance(part, CylinderPart):
            least = min(least, 2 * part.radius, part.height)
        elif isinstance(part, SpherePart):
            least = min(least, 2 * part.radius)
        else:
            return 0.0
    return least


def _shape_reach(shape: Shape) -> float:
    corner = np.maximum(np.abs(shape.lower_xyz), np.abs(shape.upper_xyz))
    return math.hypot(*shape.pose.position_xyz) + math.hypot(*corner.tolist())
