"""A robot that a body on a path presses against something: when that is noted, and when the run ends."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.simulation.pinning import MAX_SQUEEZE_M, MIN_WEIGHTS, Pinning
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
    return list(watch.notes)


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


def test_an_impact_is_no_pressure() -> None:
    watch = Pinning(within(), (0.0, 0.0, 0.0))
    watch.watch(block(1, 240, touches([100], 11 * LIMIT)))
    assert notes(watch) == []


def test_a_push_that_moves_the_robot_is_no_pressure() -> None:
    watch = Pinning(within(), (0.0, 0.0, 0.0))
    gained = 2 * LIMIT / ROBOT.mass / RATE
    speeds = [max(0, min(step, 200) - 99) * gained for step in range(1, 241)]
    watch.watch(block(1, 240, touches(range(100, 200), 2 * LIMIT), speeds))
    assert notes(watch) == []


def test_bodies_without_a_path_and_contacts_without_a_force_do_not_count() -> None:
    watch = Pinning(within(), (0.0, 0.0, 0.0))
    stuck = [touch._replace(has_force=False) for touch in touches(range(100, 200), 9 * LIMIT)]
    watch.watch(block(1, 240, stuck))
    watch.watch(block(241, 480, touches(range(300, 400), 9 * LIMIT, body="wall")))
    assert notes(watch) == []


@given(st.integers(1, 239), st.integers(12, 60), st.floats(0.5, 3.0).filter(lambda share: abs(share - 1) > 0.01))
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


def test_depth_without_pressure_does_not_end_the_run() -> None:
    watch = Pinning(within(), (0.0, 0.0, 0.0))
    seen = block(1, 240, touches(range(100, 200), 0.1 * LIMIT, depth=0.1))
    assert watch.watch(seen) == (seen, None)


def test_nothing_is_watched_without_steps() -> None:
    seen = block(1, 0)
    assert Pinning(within(), (0.0, 0.0, 0.0)).watch(seen) == (seen, None)
