"""GIF and MP4, read back by the libraries of their formats."""

from __future__ import annotations

import io
from typing import Any

import av
import numpy as np
from PIL import Image

from sim_action.recording.export.gif_film import GifFilm
from sim_action.recording.export.mp4_film import Mp4Film
from tests.recording.export.runs import run

LASTS = 0.5


def test_gif_plays_in_sim_time() -> None:
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


def test_mp4_plays_in_sim_time() -> None:
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
