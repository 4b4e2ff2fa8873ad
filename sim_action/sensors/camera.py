"""The camera: `camera: {width: 160, height: 120}`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.core.field_types import Metres, PositiveRadians
from sim_action.core.geometry import compose
from sim_action.sensors import Measure, Mount, Sensor, Sight
from sim_action.state.readings import CameraImage, EngineQueries


class Camera(Sensor):
    """Takes colour pictures with the depth of every pixel.

    The camera looks along the x axis of its frame, with y to the left and z up (REP 103), unlike ROS's optical frame. A
    reading has `rgb`, (H, W, 3) bytes, and `depth`, (H, W) in m along the x axis, inf where nothing is seen. Use
    `rgb.astype(int)` before you add bytes.

    With `f = width / 2 / tan(field_of_view / 2)`, a point (x, y, z) in the camera's frame appears in column `width / 2
    - f y / x` and row `height / 2 - f z / x`, from the top left edges.

    The picture shows the ground (grey squares of 0.5 m), objects in their `color`, and the robot, all as collision
    shapes: hulls of at most 64 points, in MJCF bounding boxes of meshes. It has no shadows or blur, and is the same on
    every engine. A shape that contains the camera is not drawn. Triangles of height fields cost 0.1 ms each.

    `trace: true` records 7 bytes per pixel, at most 500 MB.
    """

    key: ClassVar[str] = "camera"
    is_picture: ClassVar[bool] = True
    noises = ("noise",)
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
    noise: Annotated[float, Field(ge=0, le=1, description="standard deviation of each colour (0 to 1)")] = 0.0

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
        from sim_action.sensors.rendering.solids import Pinhole  # `validate` does without it

        pinhole = Pinhole(self.width, self.height, self.field_of_view, self.near, self.far)
        links, bodies = list(robot_parts(mount.scene.model)), list(world_parts(mount.scene))

        def placed(probe: EngineQueries) -> list[Placed]:
            solids = []
            for parts, pose_of in ((links, probe.link_pose), (bodies, probe.body_pose)):
                frames = {owner: pose_of(owner) for owner in {part.owner for part in parts}}
                solids += [Placed(part.solid, compose(frames[part.owner], part.pose), part.colour) for part in parts]
            return solids

        def measure(sight: Sight) -> CameraImage:
            eye = compose(sight.probe.link_pose(mount.link), mount.pose)
            picture = draw(pinhole, eye, placed(sight.probe))
            rgb = picture.rgb
            if self.noise:
                noisy = rgb + mount.random.normal(0.0, 255 * self.noise, rgb.shape)
                rgb = noisy.round().clip(0, 255).astype(rgb.dtype)
                rgb.flags.writeable = False
            return CameraImage(sight.time, rgb, picture.depth)

        return measure
