"""What a lidar makes of the ways that its rays have free."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from sim_action.core.geometry import Pose, Vector3, quaternion_from_rpy, rotate
from sim_action.sensors import Mount
from sim_action.sensors.lidar import Lidar
from sim_action.state.readings import LidarScan
from tests.scenarios import LEAST, told
from tests.sensors.stubs import OneLink, sight_of
from tests.traces import START, scene


class Fog(OneLink):
    """Where every ray has the same way free, or its own; it keeps where they were to end."""

    def __init__(self, share: float | NDArray[np.float64], link: Pose | None = None) -> None:
        super().__init__(link)
        self.share = share
        self.ends: NDArray[np.float64] | None = None

    def cast_rays(self, start_xyz: Vector3, ends_xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        self.ends = ends_xyz
        return np.full(len(ends_xyz), self.share)


def scans(lidar: Lidar, fog: Fog, *, seed: int = 0, pose: Pose | None = None, count: int = 1) -> list[LidarScan]:
    there = replace(scene(), seed=seed)
    measure = lidar.open(Mount(there, "base_scan", pose or Pose(), 10.0, there.generator("scan")))
    read = [measure(sight_of(replace(START, time=2.0), fog)) for _ in range(count)]
    assert all(isinstance(scan, LidarScan) for scan in read)
    return [scan for scan in read if isinstance(scan, LidarScan)]


def test_where_rays_end_is_the_same_to_the_last_bit_on_every_processor() -> None:
    # Products of matrices fuse multiplications with additions where a processor can.
    orientation, place = quaternion_from_rpy(0.1, 0.2, 0.3), (0.7, -1.3, 0.2)
    fog = Fog(0.5, link=Pose(place, orientation))
    (scan,) = scans(Lidar(range=3.5), fog)
    assert fog.ends is not None
    x_axis, y_axis = (rotate(orientation, axis) for axis in ((3.5, 0.0, 0.0), (0.0, 3.5, 0.0)))
    for angle, end in zip(scan.angles, fog.ends.tolist(), strict=True):
        cosine, sine = float(np.cos(angle)), float(np.sin(angle))
        parts = zip(x_axis, y_axis, place, strict=True)
        assert end == [cosine * x + sine * y + start for x, y, start in parts]


@pytest.mark.parametrize(
    ("lidar", "degrees"),
    [
        (Lidar(rays=4), (-180, -90, 0, 90)),
        (Lidar(rays=4, angle_min=0.0), (0, 90, 180, 270)),
        (Lidar(rays=3, field_of_view=math.pi), (-90, 0, 90)),
        (Lidar(rays=2, field_of_view=math.pi / 2, angle_min=1.0), (57.29578, 147.29578)),
        (Lidar(rays=1), (0,)),
        (Lidar(rays=1, field_of_view=0.1), (0,)),
    ],
)
def test_rays_fan_out_over_the_field_of_view(lidar: Lidar, degrees: tuple[float, ...]) -> None:
    fog = Fog(0.5, link=Pose((1, 2, 3), quaternion_from_rpy(0, 0, math.pi / 2)))
    (scan,) = scans(lidar, fog, pose=Pose((0.5, 0, 0)))
    assert np.degrees(scan.angles) == pytest.approx(degrees)
    assert (scan.range_min, scan.range_max, scan.time) == (0.0, 10.0, 2.0)
    turned = np.radians(degrees) + math.pi / 2
    start = np.array([1, 2.5, 3])
    assert fog.ends == pytest.approx(start + 10 * np.column_stack((np.cos(turned), np.sin(turned), 0 * turned)))


def test_the_plane_is_that_of_the_sensor() -> None:
    fog = Fog(0.5)
    # On its side: what was to its left is above it.
    scans(Lidar(rays=4, range=2.0), fog, pose=Pose(orientation_xyzw=quaternion_from_rpy(math.pi / 2, 0, 0)))
    assert fog.ends == pytest.approx(np.array([[-2, 0, 0], [0, 0, -2], [2, 0, 0], [0, 0, 2]], dtype=np.float64))


@pytest.mark.parametrize("noise", [0.0, 1e-9])
def test_too_near_and_too_far_are_told_apart(noise: float) -> None:
    shares = np.array([0.0, 0.0599, 0.0601, 1.0, np.inf])
    lidar = Lidar(rays=5, min_range=0.12, range=2.0, noise=noise)
    (scan,) = scans(lidar, Fog(shares))
    assert scan.ranges == pytest.approx([-np.inf, -np.inf, 0.1202, 2.0, np.inf])
    assert (scan.range_min, scan.range_max) == (0.12, 2.0)
    with pytest.raises(ValueError, match="read-only"):
        scan.ranges[0] = 1.0


def test_noise_is_gaussian_and_comes_from_the_seed() -> None:
    lidar = Lidar(rays=50_000, range=2.0, noise=0.01)
    first, second = scans(lidar, Fog(0.5), count=2)
    off = first.ranges - 1.0
    assert off.mean() == pytest.approx(0, abs=4 * 0.01 / math.sqrt(50_000))
    assert off.std() == pytest.approx(0.01, rel=0.02)
    # Of a normal distribution, 4.55 % are further than two standard deviations from its mean.
    assert (abs(off) > 0.02).mean() == pytest.approx(0.0455, abs=0.005)
    assert abs(np.corrcoef(off, second.ranges)[0, 1]) < 0.03
    again, other = (scans(lidar, Fog(0.5), seed=seed)[0] for seed in (0, 1))
    assert again.ranges.tolist() == first.ranges.tolist()
    assert abs(np.corrcoef(off, other.ranges)[0, 1]) < 0.03


@pytest.mark.parametrize(("share", "beyond"), [(0.1, -np.inf), (1.0, np.inf)])
def test_noise_beyond_the_measuring_range_is_no_range(share: float, beyond: float) -> None:
    (scan,) = scans(Lidar(rays=4000, min_range=0.2, range=2.0, noise=0.1), Fog(share))
    # A surface at a limit is on either side of it half of the time, and never exactly there.
    assert 1800 < (scan.ranges == beyond).sum() < 2200
    measured = scan.ranges[np.isfinite(scan.ranges)]
    assert measured.min() > 0.2
    assert measured.max() < 2.0
    assert len(set(measured.tolist())) == len(measured)
    # The rest is half of a normal distribution, whose mean is at 0.798 standard deviations.
    assert abs(measured - share * 2.0).mean() == pytest.approx(0.0798, rel=0.1)


@given(share=st.floats(0.0, 1.2), noise=st.floats(1e-6, 1.0))
def test_no_range_is_exactly_a_limit(share: float, noise: float) -> None:
    (scan,) = scans(Lidar(rays=50, min_range=0.2, range=2.0, noise=noise), Fog(share))
    assert not np.isin(scan.ranges, (0.2, 2.0)).any()
    finite = np.isfinite(scan.ranges)
    assert (scan.ranges[finite] > 0.2).all()
    assert (scan.ranges[finite] < 2.0).all()


@pytest.mark.parametrize(
    ("spec", "problem"),
    [
        ("rays: 0", "12:13: sensors.0.lidar.rays: "),
        ("rays: 100001", "12:13: sensors.0.lidar.rays: "),
        ("field_of_view: 361 deg", "12:13: sensors.0.lidar.field_of_view: expected at most 360 deg, found 361 deg"),
        ("field_of_view: 0", "12:13: sensors.0.lidar.field_of_view: "),
        ("range: 2, min_range: 2 m", "12:23: sensors.0.lidar.min_range: expected less than 'range', 2 m, found 2 m"),
        ("range: 1001", "12:13: sensors.0.lidar.range: "),
        ("noise: -1 cm", "12:13: sensors.0.lidar.noise: "),
    ],
)
def test_what_no_lidar_can_be_is_told_on_its_line(spec: str, problem: str, tmp_path: Path) -> None:
    (found,) = told(tmp_path, f"{LEAST}sensors:\n  - lidar: {{{spec}}}\n")
    assert found.startswith(problem)


def test_scans_that_no_trace_can_hold_are_told(tmp_path: Path) -> None:
    (found,) = told(tmp_path, f"{LEAST}sensors: [{{lidar: {{rays: 100000}}, rate: 240 Hz, trace: true}}]\n")
    assert "sensors.0.trace: until time_limit (30 s) its readings take 5760 MB" in found
