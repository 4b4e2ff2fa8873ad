"""Pictures for a network: the image of a camera of the scenario as an input."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

from pydantic import Field

from sim_action.core.field_types import FrozenModel
from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.wording import did_you_mean
from sim_action.core.yaml_errors import SpecProblems
from sim_action.networks.onnx_network import FLOATS, Tensor
from sim_action.sensors.camera import Camera
from sim_action.state.observation import Observation
from sim_action.world.scene import Scene

_COLOURS: Final = 3
_PerColour = float | Annotated[tuple[float, ...], Field(min_length=_COLOURS, max_length=_COLOURS)]


class Picture(FrozenModel):
    """The image of a camera as an input: `(pixel * scale - mean) / std`, with pixels from 0 to 255."""

    camera: Annotated[str, Field(description="name of a camera in `sensors`")]
    layout: Annotated[
        Literal["nchw", "nhwc"], Field(description="order of samples (N), colours (C), rows (H) and columns (W)")
    ] = "nchw"
    scale: Annotated[
        float | None, Field(gt=0, description="factor for pixels; default: 1/255 for an input of floats, else 1")
    ] = None
    mean: Annotated[_PerColour, Field(description="subtracted: a number, or one for red, green and blue")] = 0.0
    std: Annotated[_PerColour, Field(description="divisor: a number, or one for red, green and blue")] = 1.0

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield a camera that the scenario does not have, and a divisor of 0."""
        cameras = [each.name for each in scene.sensors if isinstance(each.keys, Camera)]
        if self.camera not in cameras:
            yield ("camera",), f"the scenario has no camera '{self.camera}'{did_you_mean(self.camera, cameras)}"
        if 0.0 in (self.std if isinstance(self.std, tuple) else (self.std,)):
            yield ("std",), "must not be 0: it divides"

    def shape(self, scene: Scene, tensor: Tensor) -> tuple[int, ...]:
        """Return the shape of the input; 1 in each dimension that the network has in addition."""
        keys = next(each.keys for each in scene.sensors if each.name == self.camera)
        assert isinstance(keys, Camera)
        rows, columns = keys.height, keys.width
        inner = (_COLOURS, rows, columns) if self.layout == "nchw" else (rows, columns, _COLOURS)
        return (*([1] * (max(len(tensor.shape), len(inner)) - len(inner) if tensor.shape else 1)), *inner)


class PictureInput:
    """The value of an input that takes a picture."""

    def __init__(self, picture: Picture, tensor: Tensor, shape: tuple[int, ...]) -> None:
        self._picture, self._type, self._shape = picture, tensor.type, shape
        default = 1 / 255 if tensor.type in FLOATS else 1.0
        self._scale = default if picture.scale is None else picture.scale
        self._mean, self._std = np.array(picture.mean), np.array(picture.std)

    def value(self, now: Observation, _: object) -> NDArray[Any]:
        """Return the value for this tick."""
        # A reading of another kind of sensor was refused before the run.
        pixels = np.asarray(now.sensors[self._picture.camera].columns()["rgb"])
        values = (pixels * self._scale - self._mean) / self._std
        if self._picture.layout == "nchw":
            values = np.moveaxis(values, -1, 0)
        if self._type not in FLOATS:
            limits = np.iinfo(self._type)
            values = np.clip(np.rint(values), limits.min, limits.max)
        return np.ascontiguousarray(values.reshape(self._shape), dtype=self._type)
