"""Joint damping that stops a joint within one physics step, as in models of arms: it must not add energy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from random import Random

import numpy as np
import pytest

from sim_action.robot.model.robot_spec import Robot
from sim_action.simulation.energy import Mechanics
from sim_action.state.command import JointTargets
from tests.integration.engines import advance, at, inertia, on_every_engine, running, scene_of, travelled
from tests.physics.robots import diagonal

pytestmark = on_every_engine
G = 9.80665


def link(name: str, mass: float = 0.1, moment: float = 1e-4, com: str = "0 0 0") -> str:
    inside = f'<origin xyz="{com}"/><mass value="{mass}"/>{inertia(moment)}'
    return f'<link name="{name}"><inertial>{inside}</inertial></link>'


def joint(name: str, ends: str, axis: str, damping: float, *, origin: str = "0 0 0", kind: str = "") -> str:
    parent, child = ends.split(">")
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{origin}"/><axis xyz="{axis}"/>'
    # A continuous joint without an effort limit moves freely.
    effort = 'effort="90"' if kind else ""
    limit = f'<limit lower="-9" upper="9" {effort} velocity="90"/>'
    return f'<joint name="{name}" type="{kind or "continuous"}">{ends}{limit}<dynamics damping="{damping}"/></joint>'


def robot(*parts: str) -> str:
    return f'<robot name="it">{"".join(parts)}</robot>'


FIXED = Robot(model="robot.urdf", base="fixed")


@pytest.mark.parametrize("damping", [0.1, 0.5, 5.0, 50.0])
@pytest.mark.parametrize("axis", ["0 1 0", "0 0.6 0.8"])
def test_an_arm_sinks_at_the_speed_at_which_its_damping_carries_its_weight(
    engine: str, damping: float, axis: str, tmp_path: Path
) -> None:
    # Through the damping, about a level axis or a slanted one, a tip at 0.1 m sinks slowly.
    urdf = robot(link("base", 1.0, 1.0), link("arm", com="0.1 0 0"), joint("j", "base>arm", axis, damping))
    trace = travelled(engine, scene_of(tmp_path, urdf, FIXED), 12)
    share = float(axis.split()[1])
    if damping >= 5:
        assert trace.joint_velocity[-1, 0] == pytest.approx(share * 0.1 * G * 0.1 / damping, rel=0.02)
    assert 0 < trace.joint_velocity[-1, 0] < 1.0 / damping


def rolls(damping: float) -> str:
    """A forearm of light links that roll about one axis and a wrist, with a weight at the end."""
    return robot(
        link("base", 5.0, 1.0),
        link("upper", 0.5, 1e-3, "0.1 0 0"),
        link("fore", 0.3, 1e-4, "0.05 0 0"),
        link("wrist", 0.1, 1e-5),
        link("hand", 0.2, 1e-4, "0.05 0.03 0"),
        joint("upper_roll", "base>upper", "1 0 0", damping),
        joint("fore_roll", "upper>fore", "1 0 0", damping, origin="0.2 0 0"),
        joint("wrist_bend", "fore>wrist", "0 1 0", damping / 5, origin="0.1 0 0"),
        joint("wrist_roll", "wrist>hand", "1 0 0", damping),
    )


@pytest.mark.parametrize("damping", [0.2, 5.0])
def test_a_chain_of_damped_joints_moves_as_with_small_steps(engine: str, damping: float, tmp_path: Path) -> None:
    ends = []
    for rate in (240.0, 9600.0):
        with running(engine, scene_of(tmp_path, rolls(damping), FIXED, rate=rate)) as backend:
            ends.append(advance(backend, 0, round(rate)).joint_position[-1])
    assert ends[0] == pytest.approx(ends[1], abs=0.01)


def test_damping_calms_a_joint_of_a_light_base_too(engine: str, tmp_path: Path) -> None:
    urdf = robot(link("base"), link("arm", com="0.1 0 0"), joint("j", "base>arm", "0 1 0", 5.0))
    trace = travelled(engine, scene_of(tmp_path, urdf, at(5.0)), 120, JointTargets(effort={"j": 1.0}))
    # Both parts fall alike, so the effort alone turns the joint.
    assert trace.joint_velocity[-1, 0] == pytest.approx(0.2, rel=0.02)
    assert abs(trace.turn_rate[-1]) < 1.0


def test_a_slider_whose_damping_is_too_fast_for_the_steps_is_slowed_and_noted(engine: str, tmp_path: Path) -> None:
    urdf = robot(link("base", 1.0), link("car"), joint("j", "base>car", "1 0 0", 100.0, kind="prismatic"))
    with running(engine, scene_of(tmp_path, urdf, FIXED)) as backend:
        trace, notes = advance(backend, 0, 240, JointTargets(effort={"j": 1.0})), backend.notes
    if engine == "pybullet":
        # Half of 0.1 kg in a step of 1/240 s.
        assert trace.joint_velocity[-1, 0] == pytest.approx(1 / 12, rel=0.02)
        damping = "joint 'j' has a damping of 100 N s/m, but at 240 Hz pybullet can simulate only 12 N s/m; "
        assert list(notes) == [f"{damping}set physics.rate to 2000 Hz for all of it"]
    else:
        assert trace.joint_velocity[-1, 0] == pytest.approx(0.01, rel=0.02)
        assert notes == ()
    with running(engine, scene_of(tmp_path, urdf, FIXED, rate=2000.0)) as backend:
        assert backend.notes == ()


def mechanism(chance: Random, kinds: Sequence[str]) -> str:
    """A tree of links of any mass, turned every way, whose joints have any damping."""

    def numbers(reach: float) -> str:
        return " ".join(f"{chance.uniform(-reach, reach):.4f}" for _ in range(3))

    def part(name: str) -> str:
        mass, size = 10 ** chance.uniform(-2, 1), chance.uniform(0.01, 0.3)
        xx, yy, zz = (mass * size**2 * chance.uniform(0.55, 1) for _ in range(3))
        at = f'<origin xyz="{numbers(size)}" rpy="{numbers(3)}"/>'
        return f'<link name="{name}"><inertial>{at}<mass value="{mass:.5g}"/>{diagonal((xx, yy, zz))}</inertial></link>'

    parts = [part("l0")]
    for number in range(1, chance.randint(2, 5) + 1):
        kind, axis = chance.choice(kinds), chance.choice(("1 0 0", "0 1 0", "0.6 0 0.8", "0.3 -0.4 0.866"))
        ends = f"l{chance.randint(max(0, number - 2), number - 1)}>l{number}"
        damping = 10 ** chance.uniform(-2, 3)
        origin = f'{numbers(0.3)}" rpy="{numbers(2)}'
        parts += [part(f"l{number}"), joint(f"j{number}", ends, axis, damping, origin=origin, kind=kind)]
    return robot(*parts)


@pytest.mark.parametrize("seed", range(40))
def test_damping_adds_no_energy_to_any_mechanism(engine: str, seed: int, tmp_path: Path) -> None:
    chance = Random(seed)
    urdf = mechanism(chance, [("continuous",), ("prismatic",), ("continuous", "prismatic", "fixed")][seed % 3])
    scene = scene_of(tmp_path, urdf.replace('lower="-9" upper="9"', 'lower="-1e9" upper="1e9"'), at(100.0))
    scene = scene if seed % 2 else replace(scene, robot=FIXED)
    with running(engine, scene) as backend:
        limp = JointTargets(effort=dict.fromkeys((one.name for one in scene.model.moving_joints), 0.0))
        trace = advance(backend, 0, 240, limp)
    mechanics = Mechanics(scene.model, scene.world.gravity_xyz)
    kinetic, potential = mechanics.energy(mechanics.frames(trace))
    total = kinetic + potential
    assert np.isfinite(total).all()
    assert total.max() - total[0] <= 0.3 * kinetic.max()
