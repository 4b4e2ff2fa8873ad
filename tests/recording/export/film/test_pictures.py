"""What films show: which moments, and the robot in the middle of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim_action.core.geometry import Pose, compose, inverse, quaternion_from_rpy
from sim_action.recording.export.film.digits import write
from sim_action.recording.export.film.follow_camera import HEIGHT, WIDTH, FollowCamera
from sim_action.recording.export.film.pictures import MOST_PICTURES, pictures, shown_moments
from tests.recording.export.runs import TIME, appearing, run, standing, with_bodies
from tests.traces import burger


def test_moments_come_at_the_rate_of_the_film_and_the_last_at_its_end() -> None:
    moments, speed = shown_moments(np.array(TIME), 10)
    assert moments == [0, 3, 6, 9, 12, 15]
    assert speed == 1
    assert shown_moments(np.array([0.0]), 10) == ([0], 1)


@pytest.mark.parametrize("hours", [0.1, 24])
def test_what_is_long_is_shown_faster(hours: float) -> None:
    time = np.linspace(0, hours * 3600, 5000)
    moments, speed = shown_moments(time, 20)
    assert MOST_PICTURES / 2 < len(moments) <= MOST_PICTURES + 1
    assert speed == pytest.approx(hours * 3600 * 20 / MOST_PICTURES, abs=1)
    assert (moments[0], moments[-1]) == (0, len(time) - 1)


def test_the_robot_stands_still_in_the_picture_and_its_world_moves() -> None:
    first, *_, last = pictures(run(), 10)
    assert first.shape == (HEIGHT, WIDTH, 3)
    middle = first[HEIGHT // 2, WIDTH // 2].astype(int)
    assert np.ptp(middle) == 0, "the robot is grey"
    assert middle[0] not in {140, 120}, "and not the ground"
    assert np.abs(first.astype(int) - last).sum() > 0


def test_bodies_that_move_are_shown_where_they_are() -> None:
    made = run()
    shown, empty = (
        next(pictures(with_bodies(made, ball=standing(np.tile([x, 0.5, 0.1], (len(TIME), 1)))), 10)).astype(int)
        for x in (0.4, 100.0)
    )
    # The palette's second colour is green.
    assert ((shown[..., 1] > shown[..., 0] + 40) & (shown[..., 1] > shown[..., 2] + 40)).sum() > 100
    assert ((empty[..., 1] > empty[..., 0] + 40) & (empty[..., 1] > empty[..., 2] + 40)).sum() == 0


def test_bodies_are_shown_once_they_have_appeared() -> None:
    late = appearing(TIME[15])
    empty = replace(late.scene, world=late.scene.world.model_copy(update={"objects": ()}))
    there, shown, nothing = (
        list(pictures(made, 10)) for made in (run(), late, replace(with_bodies(late), scene=empty))
    )
    assert np.array_equal(shown[0], nothing[0])
    assert not np.array_equal(shown[-1], nothing[-1])
    assert np.array_equal(shown[-1], there[-1])


def test_the_camera_looks_at_the_robot_from_behind_and_above() -> None:
    start = Pose((3.0, -2.0, 0.5), quaternion_from_rpy(0.0, 0.0, 2.0))
    camera = FollowCamera.of(burger(), start)
    pose = camera.pose(start.position_xyz)
    x, y, z = compose(inverse(pose), start).position_xyz
    assert x == pytest.approx(camera.distance, rel=0.1)
    assert y == pytest.approx(0, abs=1e-9)
    assert abs(z) < 0.2 * x
    ahead = compose(inverse(start), pose).position_xyz
    assert ahead[0] < 0 < ahead[2]


def test_the_time_stands_in_the_corner() -> None:
    picture = np.full((60, 200, 3), 7, dtype=np.uint8)
    write(picture, "1")
    bits = picture[4:25:3, 4:19:3, 0]
    assert bits.tolist() == [
        [0, 0, 0, 0, 0],
        [0, 0, 255, 0, 0],
        [0, 255, 255, 0, 0],
        [0, 0, 255, 0, 0],
        [0, 0, 255, 0, 0],
        [0, 255, 255, 255, 0],
        [0, 0, 0, 0, 0],
    ]
    assert (picture[26:] == 7).all()
    texts = ["0.0 s", "86400.0 s x1440", "123456789.0 s"]
    for text in texts:
        write(np.zeros((HEIGHT, WIDTH, 3), dtype=np.uint8), text)
