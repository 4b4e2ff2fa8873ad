"""Faults of the world: objects that are missing or elsewhere, a wall across the way, friction, a shove, the start."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Final

import numpy as np

from sim_action.core.field_types import Placement
from sim_action.core.geometry import Box, Pose, compose, multiply, quaternion_from_rpy
from sim_action.core.records import replace
from sim_action.robot.model.kinematics import link_poses, robot_box, shape_box
from sim_action.runner.mutation.mutant import Mutant, Original, lengths
from sim_action.scenario.model import DrivenActor
from sim_action.state.timeline import NOT_YET
from sim_action.world import Body, Disturbance, World
from sim_action.world.body import placed
from sim_action.world.parts import lowest

if TYPE_CHECKING:
    from sim_action.world.parts import Part

MOST_OBJECTS: Final = 5  # the number of objects that have mutants: those nearest to the way of the robot
MOST_EVENTS: Final = 5  # the number of events that have mutants: the first ones
FRICTION_DIVISOR: Final = 4.0
ICE: Final = 0.03
TURN_DEG: Final = 90.0
WALL: Final = "wall-across-the-way"
WALL_SIZE: Final = (0.1, 1.5, 0.5)  # the depth, width and least height in m of the wall across the way
SHOVE_M_S: Final = 1.0
SHOVE_S: Final = 0.1
"""A shove gives the robot the momentum of its mass at this speed, in this time: somebody walks into it."""

# The share of the way before the wall, and its least distance in m from the start.
_WALL_AT: Final = 0.6
_LEAST_TO_WALL_M: Final = 0.5
_FREE_M: Final = 0.35  # objects that move stay this far away from the start, in m
# The edges of the box in the way of an arm, the first that fits, and its least distance from the start of the link.
_BOX_SIZES_M: Final = (0.3, 0.2, 0.1, 0.05)
_LEAST_TO_BOX_M: Final = 0.1
_MOVABLE: Final = frozenset({"box", "cylinder", "sphere", "mesh", "shapes"})


def removed(original: Original) -> Iterator[Mutant]:
    """Yield a mutant without each object that no other part of the scenario names."""
    for body in _near_way(original):
        if not _is_named(original, body.name):
            others = tuple(other for other in original.scenario.world.objects if other is not body)
            yield _with_objects(original, "removed", body.name, f"the object '{body.name}' is missing", others)
    world = original.scenario.world
    for actor in world.actors[:MOST_OBJECTS]:
        words, instead = f"the robot '{actor.name}' is missing", list[DrivenActor]()
        if _is_named(original, actor.name):
            words, instead = f"the robot '{actor.name}' gets no commands", [actor.model_copy(update={"commands": ()})]
        if not instead or actor.commands:
            several = (instead if other is actor else [other] for other in world.actors)
            changed = world.model_copy(update={"actors": tuple(chain.from_iterable(several))})
            yield _in_world(original, "removed", actor.name, words, changed)


def moved(original: Original) -> Iterator[Mutant]:
    """Yield a mutant with each object moved by its own size towards the way of the robot."""
    for body in _near_way(original):
        if body.shape not in _MOVABLE or body.path:
            continue
        at = _moved_place(original, body)
        where = "nearer to the robot's way"
        if at is None and original.is_fixed:
            at = _farther_place(original, body)
            where = "farther from the robot"
        if at is None:
            continue
        shift = math.dist(at, (body.pose.x, body.pose.y))
        moved_body = body.model_copy(update={"pose": body.pose.model_copy(update={"x": at[0], "y": at[1]})})
        objects = tuple(moved_body if other is body else other for other in original.scenario.world.objects)
        words = f"the object '{body.name}' stands {shift:.2f} m {where}"
        yield _with_objects(original, "moved", body.name, words, objects)


def walled(original: Original) -> Iterator[Mutant]:
    """Yield the mutant with a wall across the way that the robot drove, or with a box in the way of an arm."""
    if original.is_fixed:
        yield from _boxed(original)
        return
    way, driven = original.way_xy, original.driven
    index = int(np.searchsorted(driven, _WALL_AT * driven[-1]))
    if index == 0 or math.dist(way[index], way[0]) < _LEAST_TO_WALL_M:
        return
    before = int(np.searchsorted(driven, max(0.0, driven[index] - 0.1)))
    dx, dy = (way[index] - way[min(before, index - 1)]).tolist()
    depth, width, height = WALL_SIZE
    height = max(height, 2 * float(original.trace.base_position_xyz[:, 2].max()))
    x, y = way[index].tolist()
    wall = Body(name=WALL, box=(depth, width, height), pose=Placement(x=x, y=y, yaw=math.atan2(dy, dx)))
    words = f"a wall stands across the way, after {driven[index]:.1f} m"
    yield _with_objects(original, "wall", "", words, (*original.scenario.world.objects, wall))


def _boxed(original: Original) -> Iterator[Mutant]:
    """Yield the mutant with the largest box in the way of the link that moved furthest, which touches nothing yet."""
    if original.moving_link is None:
        return
    link, way = original.moving_link
    away = np.linalg.norm(way - way[0], axis=1)
    moved = lengths(way)
    index = int(np.searchsorted(moved, _WALL_AT * moved[int(np.argmax(away))]))
    if away[index] < _LEAST_TO_BOX_M:
        return
    loose = [body_box(original, body) for body in original.scenario.world.objects if body.mass is not None]
    taken = [*robot_boxes(original), *loose]
    x, y, z = way[index].tolist()
    for size in _BOX_SIZES_M:
        box = Body(name=WALL, box=(size, size, size), pose=Placement(x=x, y=y, z=max(z, size / 2)))
        if not touches(body_box(original, box), taken):
            words = f"a box of {size:g} m stands in the way of link '{link}', after {moved[index]:.2f} m"
            yield _with_objects(original, "wall", "", words, (*original.scenario.world.objects, box))
            return


def slippery(original: Original) -> Iterator[Mutant]:
    """Yield the mutant with less friction of the ground, for robots that are not fixed."""
    world = original.scenario.world
    if original.is_fixed:
        return

    def with_friction(change: Callable[[float], float]) -> World:
        ground = world.ground.model_copy(update={"friction": change(world.ground.friction)})
        patches = tuple(patch.model_copy(update={"friction": change(patch.friction)}) for patch in world.patches)
        return world.model_copy(update={"ground": ground, "patches": patches})

    slippery = with_friction(lambda friction: friction / FRICTION_DIVISOR)
    ice = with_friction(lambda friction: min(friction, ICE))
    icy = _in_world(original, "slippery", "ice", f"the ground has the friction of ice, {ICE:g}", ice)
    mutant = _in_world(original, "slippery", "", "the ground has a quarter of its friction", slippery)
    yield replace(mutant, stronger=(icy,))


def calm(original: Original) -> Iterator[Mutant]:
    """Yield the mutant without disturbances, patches, noise, jitter and dropouts, if the scenario has any."""
    scenario = original.scenario
    world = scenario.world.model_copy(update={"disturbances": (), "patches": ()})
    sure = {"jitter": 0.0, "dropouts": 0.0}
    sensors = tuple(
        replace(
            mounted,
            sensor=mounted.sensor.model_copy(
                update={key: 0.0 for key in type(mounted.sensor).model_fields if key.endswith("noise") or key in sure}
            ),
        )
        for mounted in scenario.sensors
    )
    commands = tuple(source.model_copy(update=sure) for source in scenario.commands)
    still = scenario.model_copy(update={"world": world, "sensors": sensors, "commands": commands})
    if still != scenario:
        yield original.changed("calm", "", "no disturbance, patch, noise, jitter or dropout acts", still)


def uneventful(original: Original) -> Iterator[Mutant]:
    """Yield a mutant in which each of the first events never happens."""
    events = original.scenario.events
    for event in events[:MOST_EVENTS]:
        never = replace(event, when=replace(event.when, assertion=None, at=NOT_YET, event=""))
        others = tuple(never if other is event else other for other in events)
        changed = original.scenario.model_copy(update={"events": others})
        yield original.changed("uneventful", event.name, f"the event '{event.name}' never happens", changed)


def turned(original: Original) -> Iterator[Mutant]:
    """Yield the mutant whose robot begins with another heading; a keyframe states its own."""
    robot = original.scenario.robot
    if robot.keyframe is None:
        pose = robot.pose.model_copy(update={"yaw": robot.pose.yaw + math.radians(TURN_DEG)})
        turned_robot = original.scenario.model_copy(update={"robot": robot.model_copy(update={"pose": pose})})
        words = f"the robot begins with a heading that is {TURN_DEG:g} deg further left"
        yield original.changed("turned", "", words, turned_robot)


def shoved(original: Original) -> Iterator[Mutant]:
    """Yield the mutant with a push from the right against the upper edge of the robot, halfway through the run."""
    model, trace = original.loaded.model, original.trace
    if model is None or original.is_fixed:
        return
    time = float(trace.time[-1]) / 2
    row = int(np.searchsorted(trace.time, time))
    positions = dict(zip(trace.joint_names, trace.joint_position[row].tolist(), strict=True))
    box = robot_box(model, link_poses(model, positions))
    if box is None:
        return
    lower, upper = box
    force, yaw = model.mass * SHOVE_M_S / SHOVE_S, float(trace.yaw[row])
    shove = Disturbance.model_validate(
        {
            "at": time,
            "for": SHOVE_S,
            "force": (-force * math.sin(yaw), force * math.cos(yaw), 0.0),
            "point": ((lower[0] + upper[0]) / 2, lower[1], upper[2]),
        }
    )
    world = original.scenario.world
    pushed = world.model_copy(update={"disturbances": (*world.disturbances, shove)})
    words = f"a push of {force:.3g} N for {SHOVE_S:g} s from the right, at the upper edge of the robot, at {time:.1f} s"
    yield _in_world(original, "shoved", "", words, pushed)


def _with_objects(original: Original, kind: str, subject: str, words: str, objects: Sequence[Body]) -> Mutant:
    world = original.scenario.world.model_copy(update={"objects": tuple(objects)})
    return _in_world(original, kind, subject, words, world)


def _in_world(original: Original, kind: str, subject: str, words: str, world: World) -> Mutant:
    return original.changed(kind, subject, words, original.scenario.model_copy(update={"world": world}))


def _near_way(original: Original) -> list[Body]:
    """Return the objects nearest to the way of the robot, in the order of the scenario."""
    objects = original.scenario.world.objects
    away = {body.name: _nearest(original, body)[1] for body in objects}
    chosen = sorted(objects, key=lambda body: away[body.name])[:MOST_OBJECTS]
    return [body for body in objects if any(body is near_body for near_body in chosen)]


def _nearest(original: Original, body: Body, start: int = 0) -> tuple[int, float]:
    away = np.linalg.norm(original.moving_xy[start:] - (body.beginning.x, body.beginning.y), axis=1)
    index = int(np.argmin(away))
    return start + index, float(away[index])


def _moved_place(original: Original, body: Body) -> tuple[float, float] | None:
    """Return the place of an object moved by its size towards the way, not beyond it or into the robot; else None."""
    parts = parts_of(original, body)
    at = np.array((body.pose.x, body.pose.y))
    start_x, start_y = original.moving_xy[0].tolist()
    index, distance = _nearest(original, body)
    if distance == 0:
        return None
    x, y = ((original.moving_xy[index] - at) / distance).tolist()
    ahead, behind = extent(parts, body.pose, x, y), extent(parts, body.pose, -x, -y)
    if original.is_fixed:
        return free_place(original, body, (x, y), min(ahead + behind, distance))
    room = max(0.0, float(np.linalg.norm(at - (start_x, start_y))) - ahead - _FREE_M)
    # Towards the start, it stops before the robot; elsewhere, on the way.
    most = min(distance, room) if index == 0 or distance > room else distance
    shift = min(ahead + behind, most)
    if shift < LEAST_MOVE_M:
        return None
    return float(at[0] + shift * x), float(at[1] + shift * y)


def _farther_place(original: Original, body: Body) -> tuple[float, float] | None:
    """Return the place of an object that an arm comes to, moved by its size away from the base; None without one."""
    away = np.array((body.pose.x, body.pose.y)) - original.way_xy[0]
    distance = float(np.linalg.norm(away))
    if distance == 0:
        return None
    x, y = (away / distance).tolist()
    parts = parts_of(original, body)
    return free_place(original, body, (x, y), extent(parts, body.pose, x, y) + extent(parts, body.pose, -x, -y))


def _is_named(original: Original, body: str) -> bool:
    """Return True if a part of the scenario other than its objects contains the name of a body."""
    data = original.loaded.document.data
    assert isinstance(data, dict)  # the loader has looked
    named = re.compile(rf"(?<![\w-]){re.escape(body)}(?![\w-])")
    world = data.get("world")
    others = {key: value for key, value in world.items() if key not in ("objects", "actors", "file")} if world else None
    parts = [data.get("expect"), data.get("commands"), data.get("events"), others]
    return any(named.search(text) for text in _texts(parts))


def _texts(value: object) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for key, nested in value.items():
            yield from _texts(key)
            yield from _texts(nested)
    elif isinstance(value, list | tuple):
        for nested in value:
            yield from _texts(nested)


LEAST_MOVE_M: Final = 0.02  # objects move at least this far
_GAP_M: Final = 0.02  # boxes that are nearer than this in m count as touching


def robot_boxes(original: Original) -> list[Box]:
    """Return a box around each collision shape of the robot at its start, in the world frame."""
    model, trace = original.loaded.model, original.trace
    if model is None:
        return []
    x, y, z = trace.base_position_xyz[0].tolist()
    i, j, k, w = trace.base_orientation_xyzw[0].tolist()
    base = Pose((x, y, z), (i, j, k, w))
    positions = dict(zip(trace.joint_names, trace.joint_position[0].tolist(), strict=True))
    frames = link_poses(model, positions)
    placed_shapes = [(compose(base, frames[link.name]), shape) for link in model.links for shape in link.collisions]
    return [shape_box(compose(frame, shape.pose), shape) for frame, shape in placed_shapes]


def body_box(original: Original, body: Body) -> Box:
    """Return the box around an object at its initial place, in the world frame."""
    parts, at = parts_of(original, body), body.beginning
    x, y, z = placed(body, parts).position_xyz
    upside_down = multiply(quaternion_from_rpy(math.pi, 0.0, 0.0), at.orientation_xyzw)
    lower = (x - extent(parts, at, -1.0, 0.0), y - extent(parts, at, 0.0, -1.0), z + lowest(parts, at.orientation_xyzw))
    upper = (x + extent(parts, at, 1.0, 0.0), y + extent(parts, at, 0.0, 1.0), z - lowest(parts, upside_down))
    return lower, upper


def free_place(original: Original, body: Body, way: tuple[float, float], most: float) -> tuple[float, float] | None:
    """Return the farthest place on a way, in m, at which an object does not touch an arm at its start."""
    taken = robot_boxes(original)
    for shift in (most, most / 2, most / 4):
        x, y = body.pose.x + shift * way[0], body.pose.y + shift * way[1]
        moved_body = body.model_copy(update={"pose": body.pose.model_copy(update={"x": x, "y": y})})
        if shift >= LEAST_MOVE_M and not touches(body_box(original, moved_body), taken):
            return x, y
    return None


def parts_of(original: Original, body: Body) -> Sequence[Part]:
    """Return the parts of an object of the scenario, or of one that a mutant adds."""
    return original.loaded.parts[body.name] if body.is_read else body.parts()


def extent(parts: Sequence[Part], place: Placement, x: float, y: float) -> float:
    """Return how far parts reach from their frame in a direction on the ground plane, in m."""
    down = multiply(quaternion_from_rpy(0.0, math.pi / 2, 0.0), quaternion_from_rpy(0.0, 0.0, -math.atan2(y, x)))
    return max(0.0, -lowest(parts, multiply(down, place.orientation_xyzw)))


def touches(box: Box, others: Iterable[Box]) -> bool:
    """Return True if a box touches another one, or nearly does."""
    return any(_touch(box, other) for other in others)


def _touch(box: Box, other: Box) -> bool:
    (lower, upper), (least, most) = box, other
    return all(lower[axis] < most[axis] + _GAP_M and least[axis] < upper[axis] + _GAP_M for axis in range(3))
