"""GIF: `--record gif`."""

from __future__ import annotations

from typing import BinaryIO, ClassVar, Final

from sim_action.recording.export.film.pictures import pictures
from sim_action.recording.export.recorded_run import RecordedRun

RATE: Final = 10
"""Pictures in a second: browsers show no more than 50, and a hundredth of a second is the least that they tell."""

_COLOURS: Final = 64


class GifFilm:
    """A film that plays anywhere, in a README or a comment: 320x240, 10 pictures in a second of sim time.

    A camera follows the robot, and sees its collision shapes. What lasts longer than two minutes is shown faster, as
    the corner says.
    """

    extra: ClassVar[str] = "video"
    packages: ClassVar[tuple[str, ...]] = ("PIL.Image",)

    @staticmethod
    def write(run: RecordedRun, file: BinaryIO) -> None:
        """See Export.write."""
        from PIL import Image

        images = (
            Image.fromarray(picture).quantize(_COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
            for picture in pictures(run, RATE)
        )
        first = next(images)
        first.save(file, "GIF", save_all=True, append_images=images, duration=1000 // RATE, loop=0)
