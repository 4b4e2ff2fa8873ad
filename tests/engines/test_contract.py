"""The contract of an engine, on every engine of the table and on one that is added to it by one row and its folder."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.field_types import Placement
from sim_action.engines import ENGINES, EngineRow
from sim_action.robot.model.robot_spec import Robot
from sim_action.state.command import JointTargets
from sim_action.state.trace import Trace
from sim_action.world import GRAVITY, Body, Physics, World
from tests import traces
from tests.engines.fake.engine import ROW
from tests.integration.engines import BALL, LOPSIDED, advance, at, mechanism, one_link, running, scene_of
from tests.soak import examples


@pytest.fixture(params=[*ENGINES, "fake"])
def engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setitem(ENGINES, "fake", ROW)
    return str(request.param)


def test_free_fall_follows_the_parabola_of_semi_implicit_euler(engine: str, tmp_path: Path) -> None:
    with running(engine, scene_of(tmp_path, BALL, at(z=10))) as backend:
        trace = advance(backend, 0, 240)
    assert trace.base_position_xyz[-1, 2] == pytest.approx(10 - GRAVITY / 240**2 * 240 * 241 / 2, abs=1e-9)
    assert trace.base_linear_xyz[-1, 2] == pytest.approx(-GRAVITY, rel=1e-9)
    assert trace.time.tolist() == [step / 240 for step in range(1, 241)]


def test_a_state_is_that_after_its_step(engine: str, tmp_path: Path) -> None:
    with running(engine, scene_of(tmp_path, BALL, at(z=10))) as backend:
        trace = advance(backend, 0, 10)
        now = backend.observe(10, contacts=False)
    assert now.pose.position_xyz == tuple(trace.base_position_xyz[-1])
    assert now.twist.linear_xyz == tuple(trace.base_linear_xyz[-1])
    moved = np.diff(trace.base_position_xyz[:, 2]) * 240
    assert moved == pytest.approx(trace.base_linear_xyz[1:, 2], abs=1e-9)


def test_poses_are_those_of_the_link_frame(engine: str, tmp_path: Path) -> None:
    with running(engine, scene_of(tmp_path, LOPSIDED, at(x=1, y=2, z=5, roll=0.1, pitch=0.2, yaw=0.3))) as backend:
        pose = backend.observe(0, contacts=False).pose
    assert pose.position_xyz == pytest.approx((1, 2, 5), abs=1e-9)
    wanted = Placement(roll=0.1, pitch=0.2, yaw=0.3).orientation_xyzw
    assert pose.orientation_xyzw == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize("more", ["", '<origin xyz="0.4 0 0"/>'])
def test_a_fixed_base_stays_where_it_is(engine: str, more: str, tmp_path: Path) -> None:
    robot = Robot(model="robot.urdf", base="fixed", pose=Placement(x=1, z=2, yaw=0.5))
    with running(engine, scene_of(tmp_path, one_link('<sphere radius="0.1"/>', more), robot)) as backend:
        start = backend.observe(0, contacts=False).pose
        trace = advance(backend, 0, 48)
    assert start.position_xyz == pytest.approx((1, 0, 2), abs=1e-12)
    assert start.orientation_xyzw == pytest.approx((0, 0, math.sin(0.25), math.cos(0.25)), abs=1e-12)
    assert trace.base_position_xyz == pytest.approx(np.tile(start.position_xyz, (48, 1)), abs=1e-12)
    assert trace.base_orientation_xyzw == pytest.approx(np.tile(start.orientation_xyzw, (48, 1)), abs=1e-12)
    assert not trace.base_linear_xyz.any()


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_a_velocity_is_reached_within_a_step_where_the_force_allows(engine: str, kind: str, tmp_path: Path) -> None:
    scene = scene_of(tmp_path, mechanism(kind, effort=1e4, axis="1 0 0"), Robot(model="robot.urdf"))
    with running(engine, scene) as backend:
        trace = advance(backend, 0, 240, JointTargets(velocity={"joint": 1.5}))
    assert trace.joint_velocity[:, 0] == pytest.approx(1.5, rel=2e-3)
    assert trace.joint_position[-1, 0] == pytest.approx(1.5, rel=2e-3)


def test_the_same_steps_in_other_blocks_are_the_same_to_the_last_bit(engine: str, tmp_path: Path) -> None:
    def state(blocks: list[int]) -> bytes:
        with running(engine, scene_of(tmp_path, LOPSIDED, at(z=1))) as backend:
            done, parts = 0, []
            for steps in blocks:
                parts.append(advance(backend, done, steps).state)
                done += steps
        return np.concatenate(parts).tobytes()

    assert state([240]) == state([1] * 240) == state([7, 100, 133])


@pytest.mark.parametrize("rate", [1, 4, 60, 1000, 10_000])
def test_any_rate_simulates(engine: str, rate: float, tmp_path: Path) -> None:
    with running(engine, scene_of(tmp_path, BALL, at(z=1000), rate=rate)) as backend:
        steps = max(1, int(rate / 10))
        trace = advance(backend, 0, steps)
    assert trace.base_linear_xyz[-1, 2] == pytest.approx(-GRAVITY * steps / rate, rel=1e-6)
    assert Physics(rate=rate).rate == rate


def test_what_has_made_no_step_has_nothing_to_tell(tmp_path: Path, engine: str) -> None:
    with running(engine, scene_of(tmp_path, BALL, Robot(model="robot.urdf"))) as backend:
        assert len(backend.collect()) == 0


def test_every_query_has_an_answer(engine: str, tmp_path: Path) -> None:
    post = Body(name="post", box=(0.2, 0.2, 1), pose=Placement(x=3, z=0.5))
    scene = scene_of(tmp_path, mechanism(), Robot(model="robot.urdf"), World(objects=(post,)))
    with running(engine, scene, contacts=True) as backend:
        trace = advance(backend, 0, 24, JointTargets(velocity={"joint": 1.0}))
        seen = backend.observe(24, contacts=True)
        assert backend.version.startswith(f"{engine} ")
        assert (trace.contacts, tuple(seen.contacts), backend.touching()) == ((), (), ())
        assert (backend.overlaps(), backend.clashes(), backend.link_contacts(24)) == ((), (), {})
        assert backend.collect_bodies().size == 0
        assert backend.body_pose("post").position_xyz == pytest.approx((3, 0, 0.5))
        assert backend.link_pose("part").orientation_xyzw == pytest.approx(
            seen.links["part"].pose.orientation_xyzw, abs=1e-3
        )
        assert backend.link_twist("part").angular_xyz == pytest.approx((0, 0, 1), abs=1e-2)
        assert backend.cast_rays((0, 0, 50), np.array([[1.0, 0, 50]])).tolist() == [math.inf]


TURN = JointTargets(velocity={"wheel_left_joint": 3.0, "wheel_right_joint": 9.0})
STEPS = 40


@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
@examples(4)
@given(cuts=st.sets(st.integers(1, STEPS - 1)), ticks=st.sets(st.integers(1, STEPS - 1)))
def test_states_are_the_same_however_they_are_collected(engine: str, cuts: set[int], ticks: set[int]) -> None:
    pytest.importorskip(engine, reason=f"{engine} is not installed")

    def states(cuts: set[int]) -> list[Trace]:
        parts = []
        with running(engine, traces.scene()) as backend:
            assert not len(backend.collect())
            moments = sorted({0, STEPS} | cuts | ticks)
            for first, last in pairwise(moments):
                backend.advance(first, [None if first else TURN, *[None] * (last - first - 1)])
                # The last kept row is the present state.
                seen = Trace.of_observation(backend.observe(last, contacts=False)).state
                if last in cuts or last == STEPS:
                    parts.append(backend.collect())
                    assert np.array_equal(parts[-1].state[-1:], seen)
        return parts

    whole, pieces = states(set()), states(cuts)
    assert [len(whole), len(pieces)] == [1, len(cuts) + 1]
    assert np.array_equal(whole[0].state, Trace.concatenate(pieces).state)


# Adds a row to the source of the table, as a developer would, before anything reads the table.
_WITH_A_THIRD_ENGINE = """\
import sys
from importlib.util import find_spec, module_from_spec
from pathlib import Path
spec = find_spec("sim_action.engines")
first, end, rest = Path(spec.origin).read_text(encoding="utf-8").partition("\\n}\\n")
sys.modules[spec.name] = table = module_from_spec(spec)
exec(compile(f"{first}\\n    'fake': EngineRow(**{sys.argv[1]}),{end}{rest}", spec.origin, "exec"), vars(table))
from sim_action.cli.main import call
sys.exit(max([call(arguments.split()) for arguments in sys.argv[2:]]))
"""
_TURNS = """\
name: turns
robot: {model: robot.urdf}
commands: {joints: [{at: 0 s, position: {joint: 0}}, {at: 1 s, position: {joint: 1}}]}
expect: [{joint: {name: joint, near: 1 rad, tolerance: 0.02 rad}}]
backend: fake
time_limit: 2 s
"""


@pytest.mark.process
def test_one_row_adds_an_engine_to_the_program(tmp_path: Path) -> None:
    def printed(*commands: str) -> str:
        environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
        row = repr({name: getattr(ROW, name) for name in EngineRow.__slots__})
        command = [sys.executable, "-c", _WITH_A_THIRD_ENGINE, row, *commands]
        ran = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert ran.returncode == 0, ran.stdout + ran.stderr
        return ran.stdout

    def outcomes() -> list[dict[str, Any]]:
        text = (tmp_path / "sim-results/results.json").read_text(encoding="utf-8")
        return list(json.loads(text)["outcomes"])

    (tmp_path / "robot.urdf").write_text(mechanism(), encoding="utf-8")
    (tmp_path / "turns.sim.yml").write_text(_TURNS, encoding="utf-8")
    printed("validate", "run")
    assert [(run["name"], run["engine"]) for run in outcomes()] == [("turns", f"fake {np.__version__}")]
    (tmp_path / "pyproject.toml").write_text('[tool.sim-action]\nbackend = "all"\n', encoding="utf-8")
    printed("run")
    assert [run["name"] for run in outcomes()] == [f"turns [{engine}]" for engine in (*ENGINES, "fake")]
    lists = printed("run --help", "prove --help", "rostest --help", "schema")
    # In the schema, as `backend` and in `confidence.engines` of three kinds of files.
    assert (lists.count("|mujoco|fake"), lists.count('"fake"')) == (3, 6)
