"""The differences between the scenes of two replays."""

from __future__ import annotations

import pytest

from sim_action.recording.replay.scene_data import BodyData, SceneData
from sim_action.reports.html.ghosts import world_changes
from tests.outcomes import like
from tests.replays import drive

SCENE = drive().scene
WALL, *OTHERS = SCENE.bodies


def with_bodies(*bodies: BodyData) -> SceneData:
    return like(SCENE, bodies=bodies)


def named(*names: str) -> list[BodyData]:
    return [like(WALL, name=name) for name in names]


MOVED = like(WALL, pose=(WALL.pose[0] + 0.2, *WALL.pose[1:]))
TURNED = like(WALL, pose=(*WALL.pose[:3], 0.0, 0.0, 0.7071, 0.7071))


@pytest.mark.parametrize(
    ("ours", "theirs", "words"),
    [
        (SCENE, SCENE, ""),
        (SCENE, with_bodies(*OTHERS), "wall is new"),
        (with_bodies(*OTHERS), SCENE, "wall is gone"),
        (with_bodies(*named(*"abcde")), with_bodies(*named("a")), "b, c, d and 1 more are new"),
        (with_bodies(MOVED), with_bodies(WALL), "wall starts 0.2 m elsewhere"),
        (with_bodies(TURNED), with_bodies(WALL), "wall starts turned by 90 deg"),
        (with_bodies(like(WALL, shapes=())), with_bodies(WALL), "wall has another shape"),
        (drive(robot="husky").scene, SCENE, "the robot is husky, not cart"),
        (like(SCENE, links=SCENE.links[:1]), SCENE, "the model of the robot differs"),
        (with_bodies(*named("a\n<b>\u202e" + 60 * "c")), with_bodies(), f"a <b>{34 * 'c'}… is new"),
    ],
)
def test_what_differs_is_named(ours: SceneData, theirs: SceneData, words: str) -> None:
    assert world_changes(ours, theirs) == words


def test_a_difference_below_the_tolerance_of_a_motion_is_none() -> None:
    near = like(WALL, pose=(WALL.pose[0] + 0.004, *WALL.pose[1:]))
    assert world_changes(with_bodies(near), with_bodies(WALL)) == ""


def test_a_body_that_only_has_another_colour_is_the_same() -> None:
    shapes = tuple(like(shape, color=(0.1, 0.2, 0.3)) for shape in WALL.shapes)
    assert shapes != WALL.shapes
    assert world_changes(with_bodies(like(WALL, shapes=shapes)), with_bodies(WALL)) == ""
