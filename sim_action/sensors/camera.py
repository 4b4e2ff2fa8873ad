"""The camera: `camera: {width: 160, height: 120}`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.core.field_types import Metres, PositiveRadians
from sim_action.core.geometry import compose
from sim_action.sensors import Measure, Mount, Sensor, Sight
from sim_action.state.readings import CameraImage

if TYPE_CHECKING:
    from sim_action.state.sensor_inputs import EngineQueries


class Camera(Sensor):
    """Takes colour pictures with the depth of every pixel.

    The camera looks along the x axis of its frame, with y to the left and z up (REP 103). This is not the optical frame
    of ROS, whose z axis points ahead. A reading has `rgb`, (H, W, 3) bytes, and `depth`, (H, W) in m along the x axis.
    The depth is not the length of the ray; it is inf where nothing is seen. Bytes overflow: use `rgb.astype(int)`
    before you add to them.

    Row 0 is at the top, column 0 at the left. Pixels are square and sampled at their centres. With the focal length
    `f = width / 2 / tan(field_of_view / 2)`, a point (x, y, z) in the camera's frame appears in column
    `width / 2 - f y / x` and row `height / 2 - f z / x`, measured from the edges of the picture.

    The picture shows the ground (grey squares of 0.5 m), the objects of the world in their `color`, and the robot. All
    are drawn as collision shapes. A hull of a mesh is drawn from at most 64 of its points; in MJCF a mesh is drawn as
    its bounding box. Heightfields and hollow meshes are drawn as triangles, each of which costs 0.1 ms per picture.
    There are no shadows, no blur and no noise. A shape that contains the camera is not drawn. Every engine gives the
    same picture.

    `trace: true` records 7 bytes per pixel: 13 MB for 10 s at 160x120 and 10 Hz. A trace holds at most 500 MB of
    pictures.
    """

    key: ClassVar[str] = "camera"
    is_picture: ClassVar[bool] = True
    range_keys: ClassVar[Mapping[str, str]] = {"depth": "far"}

    width: Annotated[int, Field(ge=1, le=1920, description="pixels")] = 160
    height: Annotated[int, Field(ge=1, le=1080, description="pixels")] = 120
    field_of_view: Annotated[
        PositiveRadians, Field(le=math.radians(170), description="angle from the left edge to the right edge")
    ] = math.radians(60)
    near: Annotated[Metres, Field(ge=0.001, description="nearer surfaces are not seen")] = 0.05
    far: Annotated[Metres, Field(le=10_000, description="farther surfaces are not seen; the sky is shown instead")] = (
        10.0
    )

    @model_validator(mode="after")
    def _reaches_somewhere(self) -> Self:
        if self.far <= self.near:
            raise ValueError(f"'far' ({self.far:g} m) must be more than 'near' ({self.near:g} m)")
        return self

    @property
    def reading_bytes(self) -> int:
        """See Sensor.reading_bytes: three bytes of colour and four of depth per pixel."""
        return 7 * self.width * self.height

    @override
    def open(self, mount: Mount) -> Measure:
        # `validate` does without it
        from sim_action.sensors.rendering.picture import Placed, draw, robot_parts, world_parts
        from sim_action.sensors.rendering.pinhole import Pinhole  # `validate` does without it

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
