"""MP4: `--record mp4`."""

from __future__ import annotations

from typing import BinaryIO, ClassVar, Final

from sim_action.recording.export.film.follow_camera import HEIGHT, WIDTH
from sim_action.recording.export.film.pictures import pictures
from sim_action.recording.export.recorded_run import RecordedRun

RATE: Final = 20
"""Pictures in a second."""

# With threads, or with its macroblock trees, the same pictures gave one of several files.
_OPTIONS: Final = {"preset": "veryfast", "threads": "1", "x264-params": "mbtree=0"}


class Mp4Film:
    """A film as browsers play it (H.264): 320x240, 20 pictures in a second of sim time.

    A camera follows the robot, and sees its collision shapes. What lasts longer than a minute is shown faster, as the
    corner says.
    """

    extra: ClassVar[str] = "video"
    packages: ClassVar[tuple[str, ...]] = ("av",)

    @staticmethod
    def write(run: RecordedRun, file: BinaryIO) -> None:
        """See Export.write."""
        import av

        with av.open(file, "w", format="mp4") as container:
            stream = container.add_stream("libx264", rate=RATE, options=_OPTIONS)
            stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
            for picture in pictures(run, RATE):
                container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
            container.mux(stream.encode(None))
