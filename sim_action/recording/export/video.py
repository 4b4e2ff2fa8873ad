"""Videos of a run: GIF (`--record gif`) and MP4 (`--record mp4`).

A camera follows the robot and shows the sim time in a corner. The pictures are drawn by `sensors.rendering` and are
identical on every machine.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import BinaryIO, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3, quaternion_from_rpy
from sim_action.core.records import dataclass
from sim_action.core.units import TIME_EPSILON_S
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.robot.model.kinematics import link_poses, robot_box
from sim_action.robot.model.robot_model import RobotModel
from sim_action.sensors.rendering.picture import Part, Placed, draw, robot_parts, world_parts
from sim_action.sensors.rendering.solids import Pinhole
from sim_action.world import placed

GIF_RATE_HZ: Final = 10
"""The frame rate of a GIF; its format stores whole hundredths of a second, and browsers show at most 50 Hz."""

_GIF_COLOURS: Final = 64


class GifFilm:
    """An animated GIF for a README or a comment: 320x240, 10 pictures per second of sim time.

    A camera follows the robot and shows its collision shapes. A run longer than two minutes is shown faster, by the
    factor in the corner.
    """

    extra: ClassVar[str] = "video"
    packages: ClassVar[tuple[str, ...]] = ("PIL.Image",)

    @staticmethod
    def write(run: RecordedRun, file: BinaryIO) -> None:
        """Write a run; see `Export.write`."""
        from PIL import Image

        images = (
            Image.fromarray(picture).quantize(_GIF_COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
            for picture in pictures(run, GIF_RATE_HZ)
        )
        first = next(images)
        first.save(file, "GIF", save_all=True, append_images=images, duration=1000 // GIF_RATE_HZ, loop=0)


MP4_RATE_HZ: Final = 20  # the frame rate of an MP4

# With threads or macroblock trees, x264 is not deterministic.
_MP4_OPTIONS: Final = {"preset": "veryfast", "threads": "1", "x264-params": "mbtree=0"}


class Mp4Film:
    """A video for browsers (H.264): 320x240, 20 pictures per second of sim time.

    A camera follows the robot and shows its collision shapes. A run longer than a minute is shown faster, by the factor
    in the corner.
    """

    extra: ClassVar[str] = "video"
    packages: ClassVar[tuple[str, ...]] = ("av",)

    @staticmethod
    def write(run: RecordedRun, file: BinaryIO) -> None:
        """Write a run; see `Export.write`."""
        import av

        with av.open(file, "w", format="mp4") as container:
            stream = container.add_stream("libx264", rate=MP4_RATE_HZ, options=_MP4_OPTIONS)
            stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
            for picture in pictures(run, MP4_RATE_HZ):
                container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
            container.mux(stream.encode(None))


MAX_PICTURES: Final = 1_200
"""The largest number of pictures in a video: one minute at 20 Hz. A longer run is shown faster."""


def pictures(run: RecordedRun, rate: int) -> Iterator[NDArray[np.uint8]]:
    """Yield the pictures (H, W, 3) of a video with a frame rate in Hz. Raises OSError if a mesh file is missing."""
    moments, speed = shown_moments(run.trace.time, rate)
    stage = _Stage(run)
    for moment in moments:
        picture = stage.picture(moment)
        write_text(picture, f"{run.trace.time[moment]:.1f} s" + (f" x{speed}" if speed > 1 else ""))
        yield picture


def shown_moments(time: NDArray[np.float64], rate: int) -> tuple[list[int], int]:
    """Return the indices of the moments in the video, the last one included, and its speed-up factor."""
    duration = float(time[-1] - time[0])
    speed = max(1, int(np.ceil(duration * rate / MAX_PICTURES)))
    picture_times = np.append(np.arange(time[0], time[-1] - TIME_EPSILON_S, speed / rate), time[-1])
    return (np.searchsorted(time, picture_times + TIME_EPSILON_S, side="right") - 1).tolist(), speed


class _Stage:
    """The solids of the robot and its world, and the camera."""

    def __init__(self, run: RecordedRun) -> None:
        scene = run.scene
        self._run = run
        self._robot = list(robot_parts(scene.model))
        world = list(world_parts(scene))
        self._moving = [part for part in world if part.owner in run.bodies]
        fixed = {body.name: placed(body, scene.parts_of(body)) for body in scene.world.objects}
        self._fixed = _placed((part for part in world if part.owner not in run.bodies), fixed)
        self._camera = FollowCamera.of(scene.model, self._base(0))
        self._pinhole = self._camera.pinhole

    def picture(self, moment: int) -> NDArray[np.uint8]:
        base = self._base(moment)
        poses = {name: track[moment] for name, track in self._run.bodies.items()}
        bodies = {name: _pose(numbers.tolist()) for name, numbers in poses.items() if np.isfinite(numbers).all()}
        moving = _placed((part for part in self._moving if part.owner in bodies), bodies)
        model, trace = self._run.scene.model, self._run.trace
        positions = dict(zip(trace.joint_names, trace.joint_position[moment].tolist(), strict=True))
        links = link_poses(model, {**model.positions({}), **positions})
        frames = {name: geometry.compose(base, pose) for name, pose in links.items()}
        solids = [*self._fixed, *moving, *_placed(self._robot, frames)]
        return draw(self._pinhole, self._camera.pose(base.position_xyz), solids).rgb.copy()

    def _base(self, moment: int) -> Pose:
        trace = self._run.trace
        return _pose([*trace.base_position_xyz[moment].tolist(), *trace.base_orientation_xyzw[moment].tolist()])


def _placed(parts: Iterable[Part], frames: dict[str, Pose]) -> list[Placed]:
    return [Placed(part.solid, geometry.compose(frames[part.owner], part.pose), part.colour) for part in parts]


def _pose(numbers: Sequence[float]) -> Pose:
    x, y, z, qx, qy, qz, qw = numbers
    return Pose((x, y, z), (qx, qy, qz, qw))


WIDTH: Final = 320
HEIGHT: Final = 240
_FIELD_OF_VIEW: Final = math.radians(60)
# The pitch of the camera, and its yaw relative to the initial heading of the robot.
_PITCH: Final = math.radians(35)
_YAW_OFFSET: Final = math.radians(40)
# The distance as a multiple of the robot's size, and its minimum in m.
_RELATIVE_DISTANCE: Final = 2.5
_MIN_DISTANCE_M: Final = 1.2


@dataclass(frozen=True, slots=True)
class FollowCamera:
    """A camera that moves with the robot, seen from behind, right and above, but never turns."""

    heading: float  # the yaw of the view in rad, world frame
    distance: float  # the distance in m to the target point
    above: float  # the height in m of the target point above the base link

    @classmethod
    def of(cls, model: RobotModel, start: Pose) -> FollowCamera:
        """Return a camera that sees the whole robot."""
        box = robot_box(model, link_poses(model, model.positions({})))
        low, high = box or ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        size = math.dist(low, high)
        return cls(start.yaw + _YAW_OFFSET, max(_MIN_DISTANCE_M, _RELATIVE_DISTANCE * size), (low[2] + high[2]) / 2)

    @property
    def pinhole(self) -> Pinhole:
        """The projection of the camera."""
        return Pinhole(WIDTH, HEIGHT, _FIELD_OF_VIEW, 0.02 * self.distance, 100 * self.distance)

    def pose(self, base_xyz: Vector3) -> Pose:
        """Return the pose of the camera in the world for a position of the base link."""
        x, y, z = base_xyz
        back = self.distance * math.cos(_PITCH)
        up = self.above + self.distance * math.sin(_PITCH)
        place = (x - back * math.cos(self.heading), y - back * math.sin(self.heading), z + up)
        return Pose(place, quaternion_from_rpy(0.0, _PITCH, self.heading))


# The glyphs: five rows of three pixels each, as bits.
_GLYPHS: Final = {
    "0": (7, 5, 5, 5, 7),
    "1": (2, 6, 2, 2, 7),
    "2": (7, 1, 7, 4, 7),
    "3": (7, 1, 7, 1, 7),
    "4": (5, 5, 7, 1, 1),
    "5": (7, 4, 7, 1, 7),
    "6": (7, 4, 7, 5, 7),
    "7": (7, 1, 1, 1, 1),
    "8": (7, 5, 7, 5, 7),
    "9": (7, 5, 7, 1, 7),
    ".": (0, 0, 0, 0, 2),
    "s": (0, 7, 6, 3, 7),
    "x": (0, 5, 2, 5, 0),
    " ": (0, 0, 0, 0, 0),
}
_TEXT_SCALE: Final = 3
_TEXT_MARGIN: Final = 4


def write_text(picture: NDArray[np.uint8], text: str) -> None:
    """Write digits, points, "s" and "x" in white on black into the upper left corner of a picture (H, W, 3)."""
    rows = np.zeros((7, 4 * len(text) + 1), dtype=bool)
    for place, sign in enumerate(text):
        bits = np.array(_GLYPHS[sign])[:, None] >> np.array((2, 1, 0)) & 1
        rows[1:6, 4 * place + 1 : 4 * place + 4] = bits
    large = rows.repeat(_TEXT_SCALE, axis=0).repeat(_TEXT_SCALE, axis=1)
    height, width = large.shape
    picture[_TEXT_MARGIN : _TEXT_MARGIN + height, _TEXT_MARGIN : _TEXT_MARGIN + width] = np.where(large, 255, 0)[
        ..., None
    ]
