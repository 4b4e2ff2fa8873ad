"""<inertial auto>: masses and moments, against sums over thin slices of each shape."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from sim_action.core.errors import RefusedModel
from tests.robot.reading.sdf.models import load, sdf

SLICES = 4000


def auto(*collisions: str, inside: str = "") -> str:
    shapes = "".join(f'<collision name="{number}">{shape}</collision>' for number, shape in enumerate(collisions))
    return sdf(f'<link name="a"><inertial auto="true">{inside}</inertial>{shapes}</link>', version="1.11")


def shape(text: str) -> str:
    return f"<geometry>{text}</geometry>"


def read(folder: Path, text: str) -> tuple[float, list[float], dict[str, float]]:
    """Return the mass, the centre of mass and the moments."""
    inertial = ET.fromstring(load(folder, text).urdf).find("link/inertial")
    assert inertial is not None
    mass, inertia, origin = (inertial.find(tag) for tag in ("mass", "inertia", "origin"))
    assert mass is not None
    assert inertia is not None
    assert origin is not None
    moments = {name: float(value) for name, value in inertia.attrib.items()}
    return float(mass.attrib["value"]), [float(word) for word in origin.attrib["xyz"].split()], moments


def sliced(radius_at: Callable[[float], float], half: float) -> tuple[float, float, float]:
    """Return the volume, and the moments across and along z per unit of density, of a body of revolution."""
    thickness = 2 * half / SLICES
    volume = across = along = 0.0
    for number in range(SLICES):
        z = -half + (number + 0.5) * thickness
        area = math.pi * radius_at(z) ** 2
        volume += area * thickness
        along += area * radius_at(z) ** 2 / 2 * thickness
        across += area * (radius_at(z) ** 2 / 4 + z**2) * thickness
    return volume, across, along


@pytest.mark.parametrize(
    ("text", "radius_at", "half"),
    [
        ("<cylinder><radius>0.2</radius><length>0.5</length></cylinder>", lambda _: 0.2, 0.25),
        ("<sphere><radius>0.3</radius></sphere>", lambda z: math.sqrt(0.09 - z * z), 0.3),
        ("<ellipsoid><radii>0.3 0.3 0.3</radii></ellipsoid>", lambda z: math.sqrt(0.09 - z * z), 0.3),
        (
            "<capsule><radius>0.2</radius><length>0.5</length></capsule>",
            lambda z: math.sqrt(max(0.0, 0.04 - max(0.0, abs(z) - 0.25) ** 2)),
            0.45,
        ),
    ],
)
def test_a_round_shape_weighs_as_the_sum_of_its_slices(
    text: str, radius_at: Callable[[float], float], half: float, tmp_path: Path
) -> None:
    volume, across, along = sliced(radius_at, half)
    mass, centre, moments = read(tmp_path, auto(shape(text)))
    assert mass == pytest.approx(1000 * volume, rel=1e-5)
    assert centre == [0, 0, 0]
    assert moments["ixx"] == moments["iyy"] == pytest.approx(1000 * across, rel=1e-5)
    assert moments["izz"] == pytest.approx(1000 * along, rel=1e-5)
    assert moments["ixy"] == moments["ixz"] == moments["iyz"] == 0


def test_two_shapes_have_a_common_centre_and_their_own_densities(tmp_path: Path) -> None:
    """Two boxes of 0.1 m, of 1 kg at x = 0 and of 3 kg at x = 0.4: the centre of mass is at 0.3."""
    box = shape("<box><size>0.1 0.1 0.1</size></box>")
    heavy = f"<density>3000</density><pose>0.4 0 0 0 0 0.5</pose>{box}"
    mass, centre, moments = read(tmp_path, auto(box, heavy))
    own = 4 * 0.01 / 6
    assert mass == pytest.approx(4)
    assert centre == pytest.approx([0.3, 0, 0])
    assert moments["ixx"] == pytest.approx(own)
    assert moments["iyy"] == moments["izz"] == pytest.approx(own + 1 * 0.3**2 + 3 * 0.1**2)


def test_a_stated_mass_scales_the_moments(tmp_path: Path) -> None:
    turned = "<pose>0 0 0 0 0 0.5</pose>" + shape("<box><size>0.4 0.2 0.1</size></box>")
    _, _, usual = read(tmp_path, auto(turned))
    mass, _, moments = read(tmp_path, auto(turned, inside="<mass>2</mass><pose>9 9 9 0 0 0</pose>"))
    assert mass == pytest.approx(2)
    assert {name: value / 4 for name, value in usual.items()} == pytest.approx(moments)
    # A box that is longest along x has its smallest moment there; turned about z, both mix.
    a, b, c = (2 / 12 * (0.04 + 0.01), 2 / 12 * (0.16 + 0.01), 2 / 12 * (0.16 + 0.04))
    cos, sin = math.cos(0.5), math.sin(0.5)
    assert moments["ixx"] == pytest.approx(a * cos**2 + b * sin**2)
    assert moments["ixy"] == pytest.approx((a - b) * sin * cos)
    assert moments["izz"] == pytest.approx(c)


def test_a_mesh_has_no_automatic_inertia(tmp_path: Path) -> None:
    with pytest.raises(RefusedModel, match=r"<inertial auto> cannot be computed from <mesh>"):
        load(tmp_path, auto(shape("<mesh><uri>a.stl</uri></mesh>")))
