from __future__ import annotations

import random
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from sim_action.core.field_types import Placement
from sim_action.engines.engine import Engine
from sim_action.robot.model.robot_spec import Robot
from sim_action.state.command import JointTargets
from sim_action.world import Body, Physics, World
from sim_action.world.scene import Scene
from tests import traces
from tests.integration.engines import advance, running

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
TURN = JointTargets(velocity={"wheel_left_joint": 3.0, "wheel_right_joint": 2.0}, max_effort={"wheel_left_joint": 0.5})


@pytest.fixture(autouse=True)
def nothing_is_kept() -> Iterator[None]:
    with forgotten():
        yield


@contextmanager
def forgotten() -> Iterator[None]:
    """Compiles every scene anew, and forgets those of the context."""
    from sim_action.engines.mujoco.scene import _Last

    before, _Last._cached = _Last._cached, None
    yield
    _Last._cached = before


def motion(scene: Scene) -> bytes:
    """The whole motion of the robot and of the bodies, with everything in between that looks at the engine."""
    with running("mujoco", scene, contacts=True) as backend:
        parts = [repr(backend.overlaps()), repr(backend.clashes())]
        for first in (0, 30):
            trace = advance(backend, first, 30, TURN)
            ends = np.array([[2.0, 0.0, 0.1], [0.0, 2.0, 0.1]])
            parts += [backend.collect_bodies().tobytes().hex(), repr(trace.contacts), repr(backend.touching())]
            parts += [getattr(trace, name).tobytes().hex() for name in ("base_position_xyz", "joint_effort")]
            parts += [repr(backend.cast_rays((0.0, 0.0, 0.5), ends)), repr(backend.link_pose("base_scan"))]
    return "".join(parts).encode()


def scenes() -> list[Scene]:
    """Scenes of one model, equal ones next to each other in any order of their poses."""
    here = replace(traces.scene(), world=World())
    poses = [Placement(), Placement(x=0.3, yaw=1.0), Placement(z=0.2, roll=0.5)]
    started = [replace(here, robot=Robot(model=traces.BURGER, pose=pose)) for pose in poses]
    wall = World(objects=(Body(name="wall", box=(0.1, 1.0, 0.5), pose=Placement(x=0.2)),))
    cube = World(objects=(Body(name="cube", box=(0.1, 0.1, 0.1), mass=0.2, pose=Placement(x=0.2)),))
    others = [replace(each, world=world) for world in (wall, cube) for each in started]
    bolted = replace(here, robot=Robot(model=traces.BURGER, base="fixed"))
    return [*started, *others, replace(here, physics=Physics(rate=500.0)), bolted, replace(bolted, robot=here.robot)]


def test_motions_do_not_depend_on_the_scenes_before() -> None:
    every = scenes()
    alone = []
    for scene in every:
        with forgotten():
            alone.append(motion(scene))
    order = [*range(len(every))]
    random.Random(0).shuffle(order)
    # In the order of the list, equal scenes follow each other.
    for number in (*range(len(every)), *order):
        assert motion(every[number]) == alone[number], number


def test_equal_scenes_are_compiled_twice_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    from sim_action.engines.mujoco.scene import CompiledScene

    compiled = []
    compile_scene = CompiledScene._compiled.__func__  # type: ignore[attr-defined]  # a class method

    def count(cls: type[CompiledScene], scene: Scene) -> CompiledScene:
        compiled.append(scene)
        found: CompiledScene = compile_scene(cls, scene)
        return found

    monkeypatch.setattr(CompiledScene, "_compiled", classmethod(count))
    first, second, third, *_, other, _, _ = scenes()
    for scene in (first, second, third, first, third):
        motion(scene)
    assert compiled == [first, second]
    motion(other)
    motion(first)
    assert compiled == [first, second, other, first]


def test_engines_that_are_open_at_the_same_time_share_nothing() -> None:
    scene = scenes()[0]
    for _ in range(3):
        motion(scene)
    with running("mujoco", scene) as one, running("mujoco", scene) as other:
        advance(one, 0, 30, TURN)
        assert place(other) == place_at_start(scene)
    one.close()
    with running("mujoco", scene) as one, running("mujoco", scene) as other:
        advance(one, 0, 30, TURN)
        assert place(other) == place_at_start(scene)


def place(backend: Engine) -> str:
    return repr(backend.observe(0, contacts=False))


def place_at_start(scene: Scene) -> str:
    with forgotten(), running("mujoco", scene) as backend:
        return place(backend)


def test_a_step_is_not_timed_by_mujoco() -> None:
    """The clock of its profiler would take a sixth of each step; Windows does not find where to switch it off."""
    from sim_action.engines.mujoco.engine import MuJoCoEngine

    with running("mujoco", traces.scene()) as backend:
        advance(backend, 0, 30, TURN)
        assert isinstance(backend, MuJoCoEngine)
        times = backend._data.timer.duration
    assert sys.platform == "win32" or not times.any()
