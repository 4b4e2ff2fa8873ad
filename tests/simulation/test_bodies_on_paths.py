"""Bodies on paths that press the robot against something, or pass through other bodies of the world."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sim_action.scenario.stage import DEPTH
from sim_action.simulation.bodies_on_paths import MAX_SQUEEZE_M, MIN_WEIGHTS, Crossings, Pinning
from sim_action.state.observation import Contact
from sim_action.state.trace import Trace
from sim_action.world import Body, PathPoint, World
from sim_action.world.scene import Scene
from tests.traces import burger, contact, scene, trace

RATE = 240
ROBOT = burger()
PRESS = Body(name="press", box=(0.1, 1.0, 1.0), path=(PathPoint(at=0.0, x=1.0), PathPoint(at=2.0, x=0.0)))
WALL = Body(name="wall", box=(0.1, 1.0, 1.0))
LIMIT = MIN_WEIGHTS * ROBOT.mass * 9.81


def within(base: str = "free") -> Scene:
    made = scene(ROBOT)
    robot = made.robot.model_copy(update={"base": base})
    return replace(made, robot=robot, world=World(objects=(WALL, PRESS)))


def touches(steps: Iterable[int], force: float, body: str = "press", depth: float = 0.0) -> list[Contact]:
    return [contact(step / RATE, body=body, force=force)._replace(depth=depth) for step in steps]


def block(first: int, last: int, contacts: Iterable[Contact] = (), speeds: list[float] | None = None) -> Trace:
    times = [step / RATE for step in range(first, last + 1)]
    own = [touch for touch in contacts if first <= round(touch.time * RATE) <= last]
    return trace(times, speed=speeds or [0.0] * len(times), contacts=own)


def notes(watch: Pinning) -> list[str]:
    return list(watch.notes(1.0))


def test_a_long_pressure_is_noted_with_what_holds_the_robot() -> None:
    watch = Pinning(within(), (0.0, 0.0, 0.0))
    steps = range(100, 200)
    pressed = touches(steps, 1.5 * LIMIT) + touches(steps, 1.4 * LIMIT, body="wall")
    seen = block(1, 240, sorted(pressed, key=lambda touch: touch.time))
    assert watch.watch(seen) == (seen, None)
    (note,) = notes(watch)
    assert note.startswith("'press' follows its path with unlimited force and pinned 'base_footprint' against 'wall', ")
    assert f"from {(100 + 8) / RATE:.2f} s on, with up to {float(f'{1.5 * LIMIT:.2g}'):,.0f} N on average" in note
    assert note.endswith("this is the force of the engine, not of a machine")


@pytest.mark.parametrize(("base", "told"), [("free", "the ground"), ("fixed", "its own joints")])
def test_something_else_may_hold_the_robot(base: str, told: str) -> None:
    watch = Pinning(within(base), (0.0, 0.0, 0.0))
    watch.watch(block(1, 240, touches(range(100, 200), 1.5 * LIMIT)))
    assert f"against {told}, from" in notes(watch)[0]


def test_what_is_no_pressure() -> None:
    watch = Pinning(within(), (0.0, 0.0, 0.0))
    watch.watch(block(1, 240, touches([100], 11 * LIMIT)))
    assert notes(watch) == []
    # A push moves the robot.
    watch = Pinning(within(), (0.0, 0.0, 0.0))
    gained = 2 * LIMIT / ROBOT.mass / RATE
    speeds = [max(0, min(step, 200) - 99) * gained for step in range(1, 241)]
    watch.watch(block(1, 240, touches(range(100, 200), 2 * LIMIT), speeds))
    assert notes(watch) == []
    # Bodies without a path and contacts without a force do not count.
    watch = Pinning(within(), (0.0, 0.0, 0.0))
    stuck = [touch._replace(has_force=False) for touch in touches(range(100, 200), 9 * LIMIT)]
    watch.watch(block(1, 240, stuck))
    watch.watch(block(241, 480, touches(range(300, 400), 9 * LIMIT, body="wall")))
    assert notes(watch) == []
    # Depth without pressure does not end the run.
    watch = Pinning(within(), (0.0, 0.0, 0.0))
    seen = block(1, 240, touches(range(100, 200), 0.1 * LIMIT, depth=0.1))
    assert watch.watch(seen) == (seen, None)
    seen = block(1, 0)
    assert Pinning(within(), (0.0, 0.0, 0.0)).watch(seen) == (seen, None)


@given(st.integers(1, 239), st.integers(12, 60), st.floats(0.5, 3.0).filter(lambda share: abs(share - 1) > 0.01))
@example(106, 60, 1.6)  # the wall was touched in the first block alone when the press is noted
def test_blocks_of_steps_do_not_matter(cut: int, lasts: int, share: float) -> None:
    steps = range(100, 100 + lasts)
    # The robot may lose and regain its contact with the wall.
    both = touches(steps, share * LIMIT) + touches(steps[::3], LIMIT, body="wall")
    pressed = sorted(both, key=lambda touch: touch.time)
    whole, parts = Pinning(within(), (0.0, 0.0, 0.0)), Pinning(within(), (0.0, 0.0, 0.0))
    whole.watch(block(1, 240, pressed))
    parts.watch(block(1, cut, pressed))
    parts.watch(block(cut + 1, 240, pressed))
    assert bool(notes(whole)) == bool(notes(parts)) == (share > 1)
    assert notes(whole) == notes(parts)


def test_a_robot_that_is_squeezed_too_deep_ends_the_run() -> None:
    watch = Pinning(within(), (0.0, 0.0, 0.0))
    pressed = [
        contact(step / RATE, body=body, force=2 * LIMIT)._replace(depth=0.02 * (step >= 150))
        for step in range(100, 200)
        for body in ("press", "wall")
    ]
    kept, error = watch.watch(block(1, 240, pressed))
    assert len(kept) == 149
    assert error is not None
    assert error.keys == ("world", "objects", 1, "path")
    told = "'press' follows its path with unlimited force and squeezes 'base_footprint' against 'wall' by more than "
    assert f"{told}{MAX_SQUEEZE_M} m" in str(error)


PASSED_WALL = {"name": "wall", "box": (0.1, 2.0, 0.5)}


def crossings(*objects: dict[str, Any], end: float = 10.0) -> list[str]:
    made = replace(scene(), world=World.model_validate({"objects": objects}))
    return list(Crossings(made).notes(end))


def along_x(*points: tuple[float, float], name: str = "agv", **keys: Any) -> dict[str, Any]:
    """A box of 0.4 m on a path of (s, m)."""
    path = tuple({"at": at, "x": x} for at, x in points)
    return {"name": name, "box": (0.4, 0.4, 0.2), "path": path, **keys}


def test_bodies_that_pass_through_others_on_their_path_are_noted() -> None:
    # It is deep in the wall from x = -0.25 + 0.005 on.
    (note,) = crossings(PASSED_WALL, along_x((0, -2), (4, 2)))
    assert note == (
        "body 'agv' passes through body 'wall' on its path, at 1.77 s: nothing stops it, and no assertion judges two "
        "bodies of the world"
    )
    other = along_x((0, 2), (4, -2), name="other")
    (note,) = crossings(along_x((0, -2), (4, 2)), other)
    assert note.startswith("body 'other' passes through body 'agv' on its path, at 1.8")
    assert crossings(along_x((0, -2), (4, 1)), along_x((4, 2), (5, 1), (8, -2), name="other"), end=3.9) == []
    # At 2 s it is already behind the wall.
    assert crossings({**PASSED_WALL, "appears": 3.0}, along_x((0, -2), (4, 2))) == []
    assert len(crossings({**PASSED_WALL, "appears": 3.0}, along_x((0, -2), (2, 0)))) == 1


@pytest.mark.parametrize(
    "objects",
    [
        (PASSED_WALL,),
        (along_x((0, -2), (4, 2)),),
        (PASSED_WALL, along_x((0, -2), (4, -0.25))),
        (PASSED_WALL, along_x((0, -2), (4, -0.25 + 0.8 * DEPTH))),
        (PASSED_WALL, along_x((0, -2), (4, 2), pose={"z": 0.61})),
        (PASSED_WALL, along_x((0, -2), (20, 2), (30, 3))),
        ({**PASSED_WALL, "mass": 1.0}, along_x((0, -2), (4, 2))),
    ],
    ids=["no path", "alone", "touches", "a little inside", "above", "too late", "a body with a mass"],
)
def test_other_bodies_are_not(objects: tuple[dict[str, Any], ...]) -> None:
    assert crossings(*objects, end=8.0) == []


def test_each_body_is_noted_once_in_the_order_of_time() -> None:
    posts = [
        {"name": f"post {number}", "cylinder": {"radius": 0.1, "height": 1.0}, "pose": {"x": -number}}
        for number in range(3)
    ]
    found = crossings(*posts, along_x((0, -4), (4, 2), (8, -4), loop=True))
    assert [note.split("'")[3] for note in found] == ["post 2", "post 1", "post 0"]


@given(st.floats(0.02, 1.0), st.floats(0.02, 1.0), st.floats(-2, 2), st.floats(-1, 1), st.booleans())
def test_balls_are_noted_where_they_overlap(one: float, other: float, y: float, stop: float, loops: bool) -> None:
    path = [{"at": 0, "x": -3}, {"at": 6, "x": stop}, *([{"at": 12, "x": -3}] if loops else [])]
    mover = {"name": "agv", "sphere": {"radius": one}, "pose": {"y": y, "z": 2}, "path": tuple(path), "loop": loops}
    ball = {"name": "ball", "sphere": {"radius": other}, "pose": {"z": 2}}
    nearest = (min(stop, 0.0) ** 2 + y**2) ** 0.5
    deep = one + other - nearest
    if abs(deep - DEPTH) > 1e-3 and one > 2 * DEPTH:
        # Frames are 1/60 s apart, in which it moves up to 3 cm: grazes may be missed.
        assert bool(crossings(ball, mover, end=12.0)) == (deep > DEPTH) or deep < 2 * DEPTH
