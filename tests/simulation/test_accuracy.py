"""The notes on masses and depths, from contacts that an engine reports."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import pytest

from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_model import Link, RobotModel, Surface
from sim_action.robot.model.robot_spec import Robot
from sim_action.simulation.accuracy import AccuracyWatch, links_with_springs
from sim_action.state.observation import Clash, Overlap
from sim_action.world import Body, Physics, World
from sim_action.world.scene import Scene
from tests.traces import trace

FOLDER = Path("/folder")
SOFT = Link("bumper", 0.0, surface=Surface(stiffness=1e4))
MODEL = RobotModel("it", "robot.urdf", (Link("base", 40.0), Link("wheel", 10.0), SOFT), (), "")
WORLD = World(
    objects=(
        Body(name="crate", box=(1.0, 1.0, 1.0), mass=0.6),
        Body(name="can", box=(1.0, 1.0, 1.0), mass=0.4),
        Body(name="safe", box=(1.0, 1.0, 1.0), mass=61.0),
        Body(name="wall", box=(1.0, 1.0, 1.0)),
    )
)


def notes(*touches: Overlap | Clash, base: Literal["free", "fixed"] = "free") -> list[str]:
    robot = Robot.model_construct(model="robot.urdf", base=base)
    scene = Scene(robot, MODEL, WORLD, Physics(), Workspace(FOLDER, FOLDER), acted_on=True)
    watch = AccuracyWatch(scene, springs=links_with_springs(MODEL))
    for touch in touches:
        watch.add(trace([1.5]), [touch])
    return list(watch.notes())


@pytest.mark.parametrize(
    ("touch", "told"),
    [
        (Overlap("base", "can", 0.0), "link 'base' and body 'can' touched, and one has 125 times the mass"),
        (Clash("safe", "crate", -0.001), "body 'safe' and body 'crate' touched, and one has 102 times the mass"),
        (Clash("crate", "safe", 0.0), "body 'crate' and body 'safe' touched, and one has 102 times the mass"),
    ],
)
def test_masses_that_differ_by_more_than_a_hundred_times_are_noted_once(touch: Overlap | Clash, told: str) -> None:
    (note,) = notes(touch, touch)
    assert told in note


def test_unequal_masses_are_noted_once_per_pair_of_bodies() -> None:
    """The robot is one body: each of its links presses with its mass."""
    (note,) = notes(Overlap("base", "can", 0.0), Overlap("wheel", "can", 0.0), Overlap("bumper", "can", 0.0))
    assert note.startswith("link 'base' and body 'can' touched")
    assert len(notes(Clash("safe", "crate", 0.0), Clash("crate", "safe", 0.0))) == 1
    assert len(notes(Clash("safe", "crate", 0.0), Clash("can", "safe", 0.0), Overlap("wheel", "can", 0.0))) == 3


def test_the_depth_of_a_stated_spring_is_not_noted() -> None:
    assert notes(Overlap("bumper", "wall", 0.03), Overlap("bumper", "ground", 0.02)) == []
    (note,) = notes(Overlap("bumper", "wall", 0.03), Overlap("base", "wall", 0.006))
    assert note.startswith("link 'base' and body 'wall' overlapped by 0.006 m")


@pytest.mark.parametrize(
    "touch",
    [
        Overlap("base", "crate", 0.0),
        Overlap("base", "wall", 0.0),
        Overlap("wheel", "ground", 0.004),
        Clash("safe", "ground", 0.0),
        Clash("crate", "can", 0.005),
    ],
)
def test_other_contacts_are_not_noted(touch: Overlap | Clash) -> None:
    assert notes(touch) == []


def test_a_fixed_base_has_no_mass() -> None:
    assert notes(Overlap("base", "can", 0.0), base="fixed") == []


def test_the_greatest_depth_is_noted() -> None:
    wheel = Overlap("wheel", "ground", 0.0061)
    (note,) = notes(wheel, Clash("crate", "can", 0.02), wheel)
    assert note.startswith("body 'crate' and body 'can' overlapped by 0.02 m at 1.50 s: ")
    (note,) = notes(wheel)
    assert note.startswith("link 'wheel' and the ground overlapped by 0.0061 m at 1.50 s: ")


def test_depths_of_pairs_that_cannot_give_way_are_not_noted() -> None:
    inside = [Overlap("base", "wall", 0.1), Overlap("base", "ground", 0.1)]
    assert notes(*inside, base="fixed") == []
    assert len(notes(*inside)) == 1
    assert len(notes(Overlap("wheel", "wall", 0.1), base="fixed")) == 1
    assert len(notes(Overlap("base", "crate", 0.1), base="fixed")) == 1
