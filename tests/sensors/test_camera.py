"""Cameras: what a scenario may say of them, and what they tell."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.sensors import Mount
from sim_action.sensors.camera import Camera
from sim_action.state.readings import CameraImage
from sim_action.state.trace_records import SensorRecord
from sim_action.state.trace_storage import load_trace, save_trace
from tests.scenarios import LEAST, load, told
from tests.sensors.stubs import OneLink, sight_of
from tests.traces import START, scene, trace

SMALL = Camera(width=16, height=12)


def image(camera: Camera, link: Pose, pose: Pose) -> CameraImage:
    mount = Mount(scene(), "base_footprint", pose, 10.0, scene().generator("x"))
    found = camera.open(mount)(sight_of(replace(START, time=1.5), OneLink(link)))
    assert isinstance(found, CameraImage)
    return found


def test_a_picture_has_its_time_its_size_and_its_types() -> None:
    picture = image(SMALL, Pose(), Pose((0, 0, 1)))
    assert picture.time == 1.5
    assert (picture.rgb.shape, picture.depth.shape) == ((12, 16, 3), (12, 16))
    assert (picture.rgb.dtype, picture.depth.dtype) == (np.dtype(np.uint8), np.dtype(np.float32))
    assert not any(array.flags.writeable for array in (picture.rgb, picture.depth))
    # The robot itself is seen. The stub has every link at the origin: the chassis reaches from 8.5 to 151.5 mm.
    picture = image(SMALL, Pose(), Pose((-1, 0, 0.1)))
    assert picture.depth[5:7, 7:9].tolist() == [[pytest.approx(1 - 0.102, abs=1e-6)] * 2] * 2


DOWN = quaternion_from_rpy(0, math.pi / 2, 0)


def test_noise_scatters_each_colour_and_follows_the_seed() -> None:
    clean, noisy, again = (image(Camera(width=80, height=60, noise=n), Pose(), Pose((0, 0, 1))) for n in (0, 0.1, 0.1))
    # Only colours that are far enough from black and white to be scattered on both sides.
    scatter = (noisy.rgb.astype(float) - clean.rgb)[(clean.rgb > 80) & (clean.rgb < 175)]
    assert abs(scatter.std() - 25.5) < 3
    assert abs(scatter.mean()) < 3
    assert (noisy.rgb == again.rgb).all()
    assert not noisy.rgb.flags.writeable


@pytest.mark.parametrize(
    ("link", "pose"),
    [
        (Pose(), Pose((0, 0, 3), DOWN)),
        (Pose((0, 0, 3), DOWN), Pose()),
        (Pose((0, 0, 3)), Pose((0, 0, 0), DOWN)),
        (Pose((0, 0, 1), DOWN), Pose((-2, 0, 0))),
    ],
)
def test_it_sits_on_its_link_and_is_turned_with_it(link: Pose, pose: Pose) -> None:
    assert image(SMALL, link, pose).depth.max() == pytest.approx(3)


def test_a_trace_keeps_pictures(tmp_path: Path) -> None:
    pictures = [replace(image(SMALL, Pose(), Pose((0, 0, 1 + step))), time=float(step)) for step in range(3)]
    record = SensorRecord.of_readings("camera", pictures)
    save_trace(replace(trace([0.0, 1.0]), sensors={"eye": record}), tmp_path / "it.npz")
    stored = load_trace(tmp_path / "it.npz").sensors["eye"]
    for name, dtype in (("rgb", np.uint8), ("depth", np.float32)):
        assert stored.columns[name].dtype == dtype
        assert np.array_equal(stored.columns[name][2], getattr(pictures[2], name))


@pytest.mark.parametrize(
    ("sensor", "problem"),
    [
        ("{camera: {width: 1921}}", "sensors.0.camera.width: must be at most 1920, found 1921"),
        ("{camera: {height: 0}}", "sensors.0.camera.height: must be at least 1, found 0"),
        ("{camera: {width: 10.5}}", "sensors.0.camera.width: "),
        ("{camera: {field_of_view: 180 deg}}", "sensors.0.camera.field_of_view: must be at most 170 deg, found"),
        ("{camera: {near: 0}}", "sensors.0.camera.near: must be at least 0.001 m, found 0"),
        ("{camera: {far: 20 km}}", "sensors.0.camera.far: must be at most 10,000 m, found '20 km'"),
        ("{camera: {near: 1 m, far: 1 m}}", "sensors.0.camera: 'far' (1 m) must be more than 'near' (1 m)"),
        ("{camera: {near: 2 m, far: 1 m}}", "sensors.0.camera: 'far' (1 m) must be more than 'near' (2 m)"),
        ("{camera: {fov: 1}}", "sensors.0.camera.fov: unknown key"),
        (
            "{camera: {width: 1920, height: 1080}, rate: 4 Hz, trace: true}",
            "sensors.0.trace: until time_limit (30 s) its readings take 1742 MB; a trace holds 500 MB",
        ),
    ],
)
def test_what_cannot_be_is_told_on_its_line(sensor: str, problem: str, tmp_path: Path) -> None:
    (found,) = told(tmp_path, f"{LEAST}sensors: [{sensor}]\n")
    assert found.startswith("11:")
    assert problem in found


def test_pictures_that_are_not_kept_may_be_as_many_as_anybody_likes(tmp_path: Path) -> None:
    loaded = load(tmp_path, f"{LEAST}sensors: [{{camera: {{width: 1920, height: 1080}}, rate: 240}}]\n")
    assert loaded.scenario.sensors[0].sensor == Camera(width=1920, height=1080)


@pytest.mark.parametrize("color", ["[1, 0]", "[1, 0, 2]", "red"])
def test_a_colour_has_three_parts(color: str, tmp_path: Path) -> None:
    world = f"world: {{objects: [{{name: ball, sphere: {{radius: 1}}, color: {color}}}]}}\n"
    (found,) = told(tmp_path, LEAST + world)
    assert "world.objects.0.color" in found
