from __future__ import annotations

import io
from dataclasses import replace
from typing import Any

import av
import numpy as np
import pytest
from PIL import Image

from sim_action.core.geometry import Pose, compose, inverse, quaternion_from_rpy
from sim_action.recording.export.video import (
    HEIGHT,
    MAX_PICTURES,
    WIDTH,
    FollowCamera,
    GifFilm,
    Mp4Film,
    pictures,
    shown_moments,
    write_text,
)
from tests.outcomes import like
from tests.recording.export.runs import TIME, appearing, run, standing, with_bodies
from tests.traces import burger

LASTS = 0.5


def test_films_play_in_sim_time() -> None:
    # Gif plays in sim time.
    file = io.BytesIO()
    GifFilm.write(run(), file)
    with Image.open(file) as image:
        assert (image.size, image.info["loop"]) == ((320, 240), 0)
        durations, pictures = [], []
        for index in range(getattr(image, "n_frames", 1)):
            image.seek(index)
            durations.append(image.info["duration"])
            pictures.append(np.asarray(image.convert("RGB")).astype(int))
    assert durations == [100] * 6
    assert sum(durations) / 1000 - LASTS <= 0.1
    assert np.abs(pictures[0] - pictures[-1]).sum() > 0
    # Mp4 plays in sim time.
    file = io.BytesIO()
    Mp4Film.write(run(), file)
    file.seek(0)
    container: Any = av.open(file)
    with container:
        stream = container.streams.video[0]
        frames = [frame.to_ndarray(format="rgb24").astype(int) for frame in container.decode(stream)]
        assert (stream.codec_context.name, stream.average_rate, stream.pix_fmt) == ("h264", 20, "yuv420p")
    assert len(frames) == 11
    assert frames[0].shape == (240, 320, 3)
    assert np.abs(frames[0] - frames[-1]).sum() > 0


def test_moments_come_at_the_rate_of_the_film_and_the_last_at_its_end() -> None:
    moments, speed = shown_moments(np.array(TIME), 10)
    assert moments == [0, 3, 6, 9, 12, 15]
    assert speed == 1
    assert shown_moments(np.array([0.0]), 10) == ([0], 1)


@pytest.mark.parametrize("hours", [0.1, 24])
def test_what_is_long_is_shown_faster(hours: float) -> None:
    time = np.linspace(0, hours * 3600, 5000)
    moments, speed = shown_moments(time, 20)
    assert MAX_PICTURES / 2 < len(moments) <= MAX_PICTURES + 1
    assert speed == pytest.approx(hours * 3600 * 20 / MAX_PICTURES, abs=1)
    assert (moments[0], moments[-1]) == (0, len(time) - 1)


def test_robot_and_bodies_are_where_they_are_at_each_moment() -> None:
    # The robot stands still in the picture and its world moves.
    first, *_, last = pictures(run(), 10)
    assert first.shape == (HEIGHT, WIDTH, 3)
    middle = first[HEIGHT // 2, WIDTH // 2].astype(int)
    assert np.ptp(middle) == 0, "the robot is grey"
    assert middle[0] not in {140, 120}, "and not the ground"
    assert np.abs(first.astype(int) - last).sum() > 0
    # Bodies that move are shown where they are.
    made = run()
    shown, empty = (
        next(pictures(with_bodies(made, ball=standing(np.tile([x, 0.5, 0.1], (len(TIME), 1)))), 10)).astype(int)
        for x in (0.4, 100.0)
    )
    # The palette's second colour is green.
    assert ((shown[..., 1] > shown[..., 0] + 40) & (shown[..., 1] > shown[..., 2] + 40)).sum() > 100
    assert ((empty[..., 1] > empty[..., 0] + 40) & (empty[..., 1] > empty[..., 2] + 40)).sum() == 0
    # Bodies are shown once they have appeared.
    late = appearing(TIME[15])
    bare = replace(late.scene, world=like(late.scene.world, objects=()))
    there, seen, nothing = (list(pictures(made, 10)) for made in (run(), late, replace(with_bodies(late), scene=bare)))
    assert np.array_equal(seen[0], nothing[0])
    assert not np.array_equal(seen[-1], nothing[-1])
    assert np.array_equal(seen[-1], there[-1])


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
    write_text(picture, "1")
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
        write_text(np.zeros((HEIGHT, WIDTH, 3), dtype=np.uint8), text)


# Of a digit of seven segments: top, upper left, upper right, middle, lower left, lower right, bottom.
SEGMENTS = {
    "0": "1110111",
    "2": "1011101",
    "3": "1011011",
    "4": "0111010",
    "5": "1101011",
    "6": "1101111",
    "7": "1010010",
    "8": "1111111",
    "9": "1111011",
}


@pytest.mark.parametrize("digit", SEGMENTS)
def test_digits_are_made_of_seven_segments(digit: str) -> None:
    picture = np.zeros((60, 200, 3), dtype=np.uint8)
    write_text(picture, digit)
    top, upper_left, upper_right, middle, lower_left, lower_right, bottom = (one == "1" for one in SEGMENTS[digit])
    drawn = np.zeros((5, 3), dtype=bool)
    drawn[0] |= top
    drawn[2] |= middle
    drawn[4] |= bottom
    drawn[:3, 0] |= upper_left
    drawn[:3, 2] |= upper_right
    drawn[2:, 0] |= lower_left
    drawn[2:, 2] |= lower_right
    assert (picture[7:22:3, 7:16:3, 0] == 255).tolist() == drawn.tolist()
