"""Contacts that slide neither lift off nor sink in, and contacts that stick are left alone."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.field_types import Placement
from sim_action.core.geometry import Vector3
from sim_action.core.lazy_numpy import FloatArray
from sim_action.state.command import JointTargets
from sim_action.world import Body, World
from tests import traces
from tests.integration.engines import advance, at, push, running, scene_of
from tests.soak import examples

GRAVITY = 9.80665
HEIGHT = 0.1
WHEELS = ("wheel_left_joint", "wheel_right_joint")

pytest.importorskip("mujoco", reason="mujoco is not installed")


def box(friction: float, mass: float = 1.0) -> str:
    """A box of 0.2 x 0.2 x 0.1 m."""
    low, high = mass * (0.2**2 + HEIGHT**2) / 12, mass * (0.2**2 + 0.2**2) / 12
    inertia = f'<inertia ixx="{low}" iyy="{low}" izz="{high}" ixy="0" ixz="0" iyz="0"/>'
    surface = f'<gazebo reference="box"><mu1>{friction}</mu1><mu2>{friction}</mu2></gazebo>'
    return f"""<robot name="box"><link name="box"><inertial><mass value="{mass}"/>{inertia}</inertial>
        <collision><geometry><box size="0.2 0.2 {HEIGHT}"/></geometry></collision></link>{surface}</robot>"""


def shoved(folder: Path, urdf: str, velocity: Vector3, *, rate: float = 240.0, z: float | None = None) -> FloatArray:
    """The positions (T, 3) of a body that has come to rest, or that is at the height `z`, after a shove."""
    seconds = 2
    with running("mujoco", scene_of(folder, urdf, at(z), rate=rate)) as backend:
        steps = round(rate) if z is None else 0
        advance(backend, 0, steps)
        push(backend, velocity)
        return advance(backend, steps, round(seconds * rate)).base_position_xyz


@pytest.mark.parametrize("rate", [120.0, 240.0, 1000.0])
@pytest.mark.parametrize("friction", [0.2, 0.5, 1.0])
def test_a_shove_neither_lifts_a_box_nor_presses_it_in(friction: float, rate: float, tmp_path: Path) -> None:
    heights = shoved(tmp_path, box(friction), (4.0, 0.0, 0.0), rate=rate)[:, 2] - HEIGHT / 2
    assert heights.max() < 0.0005
    assert heights.min() > -0.002


@examples(20)
@given(friction=st.floats(0.1, 1.0), speed=st.floats(0.3, 6.0), direction=st.floats(0, 6.3), mass=st.floats(0.05, 50))
def test_a_shoved_box_stops_where_coulomb_says(
    friction: float, speed: float, direction: float, mass: float, tmp_path_factory: pytest.TempPathFactory
) -> None:
    way = speed * np.array([np.cos(direction), np.sin(direction), 0.0])
    x, y, z = way.tolist()
    positions = shoved(tmp_path_factory.mktemp("box"), box(friction, mass), (x, y, z))
    seconds = min(2.0, speed / (friction * GRAVITY))
    # The first row is one step after the shove.
    distance = speed * seconds - friction * GRAVITY * seconds**2 / 2 - speed / 240
    moved = positions[-1, :2] - positions[0, :2]
    assert np.linalg.norm(moved) == pytest.approx(distance, abs=0.003, rel=0.03)
    assert positions[:, 2].max() - HEIGHT / 2 < 0.001


@pytest.mark.parametrize("friction", [0.3, 1.0])
@pytest.mark.parametrize("sideways", [0.0, 0.5, 1.0, 3.0])
def test_a_box_that_lands_obliquely_does_not_sink_in(friction: float, sideways: float, tmp_path: Path) -> None:
    falls = (sideways, 0.0, -1.0)
    heights = shoved(tmp_path, box(friction), falls, z=HEIGHT / 2 + 0.02)[:, 2] - HEIGHT / 2
    straight = shoved(tmp_path, box(friction), (0.0, 0.0, -1.0), z=HEIGHT / 2 + 0.02)[:, 2] - HEIGHT / 2
    assert heights.min() > straight.min() - 0.004
    assert abs(heights[-1]) < 0.0005


def test_a_shove_does_not_lift_a_soft_box_that_began_exactly_on_the_ground(tmp_path: Path) -> None:
    """At a depth of 0, its contacts are there but have no rows yet."""
    soft = box(1.0).replace("</gazebo>", "<kp>1e5</kp><kd>4e3</kd></gazebo>")
    heights = shoved(tmp_path, soft, (2.0, 0.0, 0.0))[:, 2] - HEIGHT / 2
    assert heights.max() < 0.0005


def test_a_box_at_rest_is_left_alone(tmp_path: Path) -> None:
    from sim_action.engines.mujoco.engine import MuJoCoEngine

    with running("mujoco", scene_of(tmp_path, box(0.5), at())) as backend:
        assert isinstance(backend, MuJoCoEngine)
        advance(backend, 0, 240)
        before = backend._data.efc_aref.copy()
        backend._sliding.correct(memoryview(backend._data.efc_aref))
        assert backend._data.ncon == 4
        assert np.array_equal(before, backend._data.efc_aref)


def test_without_friction_nothing_is_corrected(tmp_path: Path) -> None:
    positions = shoved(tmp_path, box(0.0), (2.0, 0.0, 0.0))
    assert positions[-1, 0] - positions[0, 0] == pytest.approx(2.0 * 2 - 2.0 / 240, abs=1e-3)
    assert np.abs(positions[:, 2] - HEIGHT / 2).max() < 0.0005


def test_a_robot_that_drives_into_a_wall_does_not_hop(tmp_path: Path) -> None:
    """It stops within a step while its wheels turn on, so that their slip arises in this step."""
    wall = Body(name="wall", box=(0.1, 1.0, 0.5), pose=Placement(x=0.3))
    scene = replace(traces.scene(), world=World(objects=(wall,)))
    with running("mujoco", scene, contacts=True) as backend:
        advance(backend, 0, 240)
        speeds = [dict.fromkeys(WHEELS, 0.2 * step / 48 / 0.033) for step in range(49)]
        trace = advance(backend, 240, 720, *(JointTargets(velocity=speed) for speed in speeds))
    heights = trace.base_position_xyz[:, 2]
    assert trace.contacts
    assert heights.max() - heights[0] < 0.0002


def is_calm(values: list[float], friction: float, yields: float) -> bool:
    """Rows of a contact without friction, and of two with it."""
    contacts = [values[1:4], values[4:7]]
    slides = [math.hypot(x, y) > yields / friction + friction * max(normal, 0.0) for normal, x, y in contacts]
    return not any(slides) and max(values[0], values[1], values[4]) <= 5.0


NORMAL = st.floats(-6, 5)
SLIP = st.tuples(NORMAL, st.floats(0, 0.999), st.floats(0, 6.3))


@examples(50)
@given(
    normal=NORMAL,
    slips=st.tuples(SLIP, SLIP),
    way=st.lists(st.floats(-1, 1), min_size=7, max_size=7).filter(any),
    share=st.floats(0, 0.999),
    friction=st.floats(0.01, 2),
)
def test_references_near_those_of_a_calm_step_are_calm(
    normal: float, slips: tuple[tuple[float, float, float], ...], way: list[float], share: float, friction: float
) -> None:
    """A slip is a normal, the share of the least slip that is corrected, and a direction."""
    from sim_action.engines.mujoco.sliding import _Pair, _Touching

    yields = 0.3
    values = [normal]
    for upward, size, direction in slips:
        slip = size * (yields / friction + friction * max(upward, 0.0))
        values += upward, slip * math.cos(direction), slip * math.sin(direction)
    assert is_calm(values, friction, yields)
    pairs = [_Pair(friction, yields, [(-6, -5, -4)]), _Pair(friction, yields, [(-3, -2, -1)])]
    touching = _Touching(pairs, [-7, -6, -3], [0, 0, 0], lambda *_: (), 0, (), 0.0)
    touching.settle(tuple(values))
    if touching.calm_within > 0:
        there = np.array(values) + np.array(way) / math.hypot(*way) * share * touching.calm_within
        assert is_calm(there.tolist(), friction, yields)


@pytest.mark.parametrize("targets", [(6.0, 6.0), (4.0, 8.0), (-9.0, 9.0)])
def test_a_robot_moves_the_same_if_every_step_is_checked_in_full(targets: tuple[float, float], tmp_path: Path) -> None:
    from sim_action.engines.mujoco.engine import MuJoCoEngine

    states = []
    for checks_all in (False, True):
        with running("mujoco", traces.scene()) as backend:
            assert isinstance(backend, MuJoCoEngine)
            commands = [JointTargets(velocity=dict(zip(WHEELS, speeds, strict=True))) for speeds in (targets, (2, 2))]
            rows = []
            for step in range(120):
                rows.append(advance(backend, step, 1, *commands[step // 60 : step // 60 + 1] * (step % 60 == 0)).state)
                for found in backend._sliding._known.values() if checks_all else ():
                    found.calm_within = 0.0
            states.append(np.concatenate(rows))
    one, other = states
    assert np.array_equal(one, other)


@examples(5)
@given(periods=st.lists(st.integers(1, 40), min_size=1, max_size=8))
def test_a_run_is_the_same_however_it_is_cut_into_periods(periods: list[int]) -> None:
    turn = JointTargets(velocity=dict(zip(WHEELS, (3.0, 9.0), strict=True)))
    states = []
    for lengths in (periods, [sum(periods)]):
        with running("mujoco", traces.scene()) as backend:
            starts = np.cumsum([0, *lengths]).tolist()
            first = [turn]
            parts = []
            for start, length in zip(starts, lengths, strict=False):
                parts.append(advance(backend, start, length, *first).state)
                first = []
            states.append(np.concatenate(parts))
    one, other = states
    assert np.array_equal(one, other)
