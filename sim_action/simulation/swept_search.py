"""The search for a step in which a convex piece passed through another one.

A piece passed through another if they touch at neither end of the step, but the hull of both ends overlaps the other
piece. Only few runs are fast enough to need this module.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sim_action.assertions.monitors.base_motion import BaseMotion
from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass, replace
from sim_action.robot.model.kinematics import Frames, frames_of, link_frames
from sim_action.simulation.convex_pieces import (
    Obstacle,
    Piece,
    hull_distance,
    link_pieces,
    part_pieces,
    part_soups,
    turned,
)
from sim_action.simulation.fast_motion import FIXED, Block, Miss, Parts
from sim_action.state.trace_records import ALWAYS
from sim_action.world import MAX_SPEED, placed

# A piece that only grazes another, with less than this share of its size, does not pass through it.
_GRAZE: Final = 0.02
# The hull of both ends of a turn by this angle differs from the way by at most 0.5 % of the piece.
_TURN_RAD: Final = 0.2
_MAX_TURNS: Final = 32
_SMALL_SWING: Final = 0.1  # below this share of the width, turning does not matter for the extent along the way
_TOUCH_M: Final = 1e-7  # nearer hulls touch
_BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class _Motion:
    """The motion of a link or body in a block of T steps."""

    name: str  # of the link or body, as in messages
    pieces: Sequence[Piece]
    frames: Frames  # its frame at T + 1 moments
    turning: FloatArray  # (T,) an upper bound in rad on its rotation in each step
    is_continuous: _BoolArray  # (T,) False for steps in which something set it to another place

    def seen_from(self, other: _Motion) -> _Motion:
        """Return the same motion in the frame of another body."""
        frames = geometry.compose(geometry.inverse(other.frames), self.frames)
        return replace(
            self,
            frames=frames,
            turning=self.turning + other.turning,
            is_continuous=self.is_continuous & other.is_continuous,
        )


class SweptSearch:
    """Searches blocks of steps; it keeps the convex pieces of links and bodies."""

    def __init__(self, parts: Parts) -> None:
        self._parts, self._scene = parts, parts.scene
        self._rate = parts.scene.physics.rate
        self._pieces: dict[int, tuple[Piece, ...]] = {}
        self._obstacles: dict[int, Obstacle] = {}

    def first_miss(self, block: Block, pairs: Iterable[tuple[int, int]]) -> Miss | None:
        """Return the first missed contact of some pairs of a part and an obstacle."""
        best = None
        end = len(block.trace)
        first = round(float(block.trace.time[0]) * self._rate)
        frames = self._link_frames(block)
        for part, other in pairs:
            motion = self._motion(block, frames, part)
            if other != FIXED:
                motion = motion.seen_from(self._motion(block, frames, len(self._parts.links) + other))
            is_body = part >= len(self._parts.links)
            miss = _Search(motion, self._obstacle(other), first, is_body=is_body).first_miss(end)
            if miss is not None:
                best, end = miss, miss.row
        return best

    def links(self, block: Block, numbers: Iterable[int], robot: str) -> Mapping[int, tuple[_Motion, Obstacle | None]]:
        """Return link -> its motion, and the link as an obstacle for another robot; None if it has no pieces."""
        frames = self._link_frames(block)
        return {link: (self._motion(block, frames, link), self._link_obstacle(link, robot)) for link in numbers}

    def _link_obstacle(self, link: int, robot: str) -> Obstacle | None:
        name, pieces = f"{robot}/{self._parts.links[link]}", self._pieces_of(link)
        return Obstacle.of([(name, ALWAYS, Pose(), pieces, ())]) if pieces else None

    def _motion(self, block: Block, frames: Mapping[str, Frames], part: int) -> _Motion:
        """Return the motion of a link or mover."""
        links = self._parts.links
        if part < len(links):
            trace, joints = block.trace, len(block.trace.joint_names)
            turned_joints = np.abs(trace.state[:, 14 + joints : 14 + 2 * joints])
            speeds = np.column_stack((trace.speed, trace.turn_rate, turned_joints))
            turning = speeds @ self._parts.turns[part] / self._rate
            name = f"link '{links[part]}'"
            return _Motion(name, self._pieces_of(part), frames[links[part]], turning, _is_driven(block))
        number = part - len(links)
        mover = self._parts.movers[number]
        name, pieces = f"body '{mover.body.name}'", self._pieces_of(part)
        if mover.path is None:
            poses = frames_of(block.poses[:, number, :3], block.poses[:, number, 3:])
            # Something else than the engine set it to another place, for example when it appeared.
            was_set = block.moved[:, number] > MAX_SPEED / self._rate
            return _Motion(name, pieces, poses, block.turned[:, number], ~was_set)
        times = np.append(block.before[0], block.trace.time).tolist()
        path = [mover.path.pose(time) for time in times]
        places = np.array([pose.position_xyz for pose in path])
        turns = np.array([pose.orientation_xyzw for pose in path])
        turning = np.full(len(block.trace), mover.turns / self._rate)
        return _Motion(name, pieces, frames_of(places, turns), turning, np.full(len(turning), fill_value=True))

    def _link_frames(self, block: Block) -> Mapping[str, Frames]:
        rows = np.vstack((block.before, block.trace.state))
        joints = len(block.trace.joint_names)
        return link_frames(self._scene.model, frames_of(rows[:, 1:4], rows[:, 4:8]), rows[:, 14 : 14 + joints])

    def _pieces_of(self, part: int) -> tuple[Piece, ...]:
        """Return the convex pieces of a link or mover, without the surfaces of a mover."""
        if part not in self._pieces:
            links = self._parts.links
            if part < len(links):
                made = link_pieces(self._scene.model.links_by_name[links[part]].collisions)
            else:
                made = part_pieces(self._scene.parts_of(self._parts.movers[part - len(links)].body))
            self._pieces[part] = tuple(made)
        return self._pieces[part]

    def _obstacle(self, number: int) -> Obstacle:
        """Return a mover in its own frame, or all fixed bodies in the world frame."""
        if number not in self._obstacles:
            bodies = self._parts.fixed if number == FIXED else (self._parts.movers[number].body,)
            shapes = []
            for body in bodies:
                parts = self._scene.parts_of(body)
                pose = placed(body, parts) if number == FIXED else Pose()
                presence = body.presence(self._rate) if number == FIXED else ALWAYS
                soups = part_soups(parts, is_solid=self._parts.solid_terrain)
                shapes.append((body.name, presence, pose, tuple(part_pieces(parts)), tuple(soups)))
            self._obstacles[number] = Obstacle.of(shapes)
        return self._obstacles[number]


def first_meeting(
    robots: Sequence[SweptSearch], blocks: Sequence[Block], pairs: Sequence[tuple[int, int]], name: str
) -> Miss | None:
    """Return the first missed contact of pairs of links of two robots; `name`: of the second one."""
    ours, theirs = (
        robot.links(block, {pair[side] for pair in pairs}, name)
        for side, (robot, block) in enumerate(zip(robots, blocks, strict=True))
    )
    best = None
    end = len(blocks[0].trace)
    for link, against in pairs:
        motion, obstacle = theirs[against]
        if obstacle is not None:
            miss = _Search(ours[link][0].seen_from(motion), obstacle, 0, is_body=False).first_miss(end)
            best, end = (best, end) if miss is None else (miss, miss.row)
    return best


def _is_driven(block: Block) -> _BoolArray:
    motion, trace = BaseMotion(math.inf, (tuple(block.before[:14].tolist()),)), block.trace
    return np.asarray((motion.speed(trace) == trace.speed) & (motion.turn_rate(trace) == trace.turn_rate))


class _Search:
    """The search for steps in which a piece passes through an obstacle; `first`: number of the state after the first.

    It works in the frame of the obstacle. `is_body`: True for a body of the world, whose contacts no expectation sees.
    """

    def __init__(self, motion: _Motion, obstacle: Obstacle, first: int, *, is_body: bool) -> None:
        self._motion, self._obstacle, self._first, self._is_body = motion, obstacle, first, is_body
        (x, y, z), turns = motion.frames.position_xyz, motion.frames.orientation_xyzw
        count = len(motion.turning) + 1
        self._places = np.column_stack([np.broadcast_to(column, count) for column in (x, y, z)])
        self._turns = np.column_stack([np.broadcast_to(column, count) for column in turns])

    def first_miss(self, end: int) -> Miss | None:
        """Return the first missed contact before the step with the index `end`."""
        best = None
        for piece in self._motion.pieces:
            for row, way, extent in self._fast_steps(piece, end):
                body = self._passed(piece, row)
                if body is not None:
                    name, thickness, is_late = body
                    best, end = Miss(row, self._motion.name, f"body '{name}'", way, extent, thickness, is_late), row
                    break
        return best

    def _fast_steps(self, piece: Piece, end: int) -> list[tuple[int, float, float]]:
        """Return steps with more motion than extent of a piece and least thickness, with motion and extent in m."""
        motion, thickness = self._motion, self._obstacle.least_thickness
        orientation: Any = tuple(self._turns.T)
        x, y, z = geometry.rotate(orientation, tuple(piece.centre.tolist()))
        ways = np.diff(self._places + np.column_stack((x, y, z)), axis=0)[:end]
        lengths = np.sqrt(np.square(ways).sum(axis=1))
        swings = np.zeros(len(ways)) if piece.is_ball else motion.turning[:end] * piece.reach
        fast = (lengths + swings > piece.width + thickness) & motion.is_continuous[:end]
        rows = np.flatnonzero(fast)
        if not len(rows):
            return []
        back: Any = tuple((self._turns[rows] * (-1, -1, -1, 1)).T)
        along: Any = tuple((ways[rows] / np.maximum(lengths[rows], 1e-12)[:, None]).T)
        extents = piece.extents(np.column_stack(geometry.rotate(back, along)))
        swinging = swings[rows] > _SMALL_SWING * piece.width
        moved = np.where(swinging, lengths[rows] + swings[rows], lengths[rows])
        extents = np.where(swinging, piece.width, extents)
        exceeds = moved > extents + thickness
        return list(zip(rows[exceeds].tolist(), moved[exceeds].tolist(), extents[exceeds].tolist(), strict=True))

    def _passed(self, piece: Piece, row: int) -> tuple[str, float, bool] | None:
        """Return the name and the thickness in m of a body that a piece passes through in a step, and if they touch."""
        obstacle = self._obstacle
        poses = list(self._poses(piece, row))
        ends = [turned(piece.points - piece.centre, turns) + place for place, turns in (poses[0], poses[-1])]
        middles = np.array([place for place, _ in poses])
        lower, upper = middles.min(axis=0) - piece.reach, middles.max(axis=0) + piece.reach
        near = obstacle.near(lower, upper, self._first + row)
        if not near:
            return None
        own = (piece.points - piece.centre) * (1 - _GRAZE)
        hulls = [turned(own, turns) + place for place, turns in poses]
        sweeps = [np.vstack(pair) for pair in pairwise(hulls)]
        for index in near:
            other = obstacle.corners(index)
            reach = float(obstacle.radius[index])
            limit = piece.radius * (1 - _GRAZE) + reach
            if not any(_overlap(sweep, other, limit) for sweep in sweeps):
                continue
            is_late = self._touches(piece, ends, near, index)
            if not is_late or (self._is_body and _overlap(middles, other, reach)):
                return obstacle.names[int(obstacle.bodies[index])], float(obstacle.thickness[index]), is_late
        return None

    def _touches(self, piece: Piece, ends: Sequence[FloatArray], near: Sequence[int], index: int) -> bool:
        """Return True if a piece touches the group of another piece at an end of a step."""
        obstacle = self._obstacle
        group = [other for other in near if obstacle.groups[other] == obstacle.groups[index]]
        limits = (piece.radius + float(obstacle.radius[other]) for other in group)
        return any(
            _overlap(end, obstacle.corners(other), limit)
            for other, limit in zip(group, limits, strict=True)
            for end in ends
        )

    def _poses(self, piece: Piece, row: int) -> Iterator[tuple[FloatArray, geometry.Quaternion]]:
        """Yield places (3,) of the centre and orientations of a piece during a step, with small turns between them."""
        before, after = self._turns[row], self._turns[row + 1]
        after = after if before @ after >= 0 else -after
        count = 1 if piece.is_ball else math.ceil(min(self._motion.turning[row] / _TURN_RAD, _MAX_TURNS - 1)) or 1
        for share in np.linspace(0.0, 1.0, count + 1).tolist():
            between = before + (after - before) * share
            x, y, z, w = (between / math.sqrt(between @ between)).tolist()
            place = self._places[row] + (self._places[row + 1] - self._places[row]) * share
            yield place + turned(piece.centre[None], (x, y, z, w))[0], (x, y, z, w)


def _overlap(one: FloatArray, other: FloatArray, limit: float) -> bool:
    return hull_distance(one, other, limit) <= max(limit, _TOUCH_M)
