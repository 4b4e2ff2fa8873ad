"""Pictures: `camera`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, ClassVar, Self

from pydantic import Field, model_validator

from sim_action.core.field_types import Metres, PositiveRadians
from sim_action.core.geometry import compose
from sim_action.sensors import Measure, Mount, Sensor, Sight
from sim_action.state.readings import CameraImage

if TYPE_CHECKING:
    from sim_action.state.sensor_inputs import EngineQueries


class Camera(Sensor):
    """Takes pictures in colour, with the depth of every pixel.

    It looks along the x axis of its own frame, with y to the left and z up, as robots have it (REP 103; not the optical
    frame of ROS, whose z axis looks ahead). A reading has `rgb`, (H, W, 3) bytes (`rgb.astype(int)` before you add
    to them: bytes overflow), and `depth`, (H, W) in m along the x axis, which is not the length of the ray, and inf
    where nothing is.

    Row 0 is at the top, column 0 at the left. Pixels are square and taken at their middle. With the focal length
    `f = width / 2 / tan(field_of_view / 2)`, what is at (x, y, z) in the frame of the camera is in column
    `width / 2 - f y / x` and in row `height / 2 - f z / x`, counted from the edges of the picture.

    It sees the ground (grey squares of 0.5 m), the objects of the world in their `color`, and the robot itself, all as
    what collides: a hull of a mesh as that of at most 64 of its points, or, in MJCF, as the box around it; heightfields
    and hollow meshes as their triangles, each of which takes 0.1 ms of a picture. There are no shadows, no blur and no
    noise. What the camera is inside of is not seen. Every engine gives the same picture.

    `trace: true` keeps 7 bytes for each pixel of each picture: at 160x120 and 10 Hz, 13 MB for 10 s. A trace keeps
    500 MB of pictures at the most.
    """

    key: ClassVar[str] = "camera"

    width: Annotated[int, Field(ge=1, le=1920, description="pixels")] = 160
    height: Annotated[int, Field(ge=1, le=1080, description="pixels")] = 120
    field_of_view: Annotated[
        PositiveRadians, Field(le=math.radians(170), description="from the left edge to the right one")
    ] = math.radians(60)
    near: Annotated[Metres, Field(ge=0.001, description="what is nearer is not seen")] = 0.05
    far: Annotated[Metres, Field(le=10_000, description="what is further is not seen, and looks like the sky")] = 10.0

    @model_validator(mode="after")
    def _reaches_somewhere(self) -> Self:
        if self.far <= self.near:
            raise ValueError(f"'far' ({self.far:g} m) must be more than 'near' ({self.near:g} m)")
        return self

    @property
    def reading_bytes(self) -> int:
        """See Sensor.reading_bytes: three of colour and four of depth for each pixel."""
        return 7 * self.width * self.height

    def open(self, mount: Mount) -> Measure:
        """See Sensor.open."""
        from sim_action.sensors.rendering.appearance import robot_parts, world_parts
        from sim_action.sensors.rendering.picture import Placed, draw
        from sim_action.sensors.rendering.pinhole import Pinhole

        pinhole = Pinhole(self.width, self.height, self.field_of_view, self.near, self.far)
        links, bodies = list(robot_parts(mount.scene.model)), list(world_parts(mount.scene))

        def placed(probe: EngineQueries) -> list[Placed]:
            found = []
            for parts, pose_of in ((links, probe.link_pose), (bodies, probe.body_pose)):
                frames = {owner: pose_of(owner) for owner in {part.owner for part in parts}}
                found += [Placed(part.solid, compose(frames[part.owner], part.pose), part.colour) for part in parts]
            return found

        def measure(sight: Sight) -> CameraImage:
            eye = compose(sight.probe.link_pose(mount.link), mount.pose)
            picture = draw(pinhole, eye, placed(sight.probe))
            return CameraImage(sight.time, picture.rgb, picture.depth)

        return measure
