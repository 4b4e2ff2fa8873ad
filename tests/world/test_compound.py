"""Bodies of several shapes, and stated mass properties."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.world import Body, placed
from sim_action.world.mass_properties import mass_properties_of
from sim_action.world.parts import BoxPart, CylinderPart, HullPart, SpherePart, moved

TABLE: dict[str, Any] = {
    "name": "table",
    "shapes": (
        {"box": (1.0, 0.6, 0.04), "pose": {"z": 0.72}},
        {"cylinder": {"radius": 0.05, "height": 0.7}, "pose": {"z": 0.35}},
    ),
}


def test_the_shapes_of_a_body_are_placed_in_its_frame() -> None:
    body = Body.model_validate(TABLE)

    top, leg = body.parts()
    assert (body.shape, body.is_read, body.has_own_inertia) == ("shapes", False, False)
    assert isinstance(top, BoxPart)
    assert top.pose == Pose((0.0, 0.0, 0.72))
    assert isinstance(leg, CylinderPart)
    assert leg.pose == Pose((0.0, 0.0, 0.35))
    assert placed(body, body.parts()).position_xyz == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"shapes": ()}, "at least 1 item"),
        ({"shapes": ({},)}, "needs exactly one of box, cylinder"),
        ({"shapes": ({"box": (1, 1, 1), "sphere": {"radius": 1}},)}, "'box' and 'sphere' are in one shape; begin each"),
        ({"shapes": ({"sphere": {"radius": 1}},), "sphere": {"radius": 1}}, "found 'sphere' and 'shapes'"),
        ({"sphere": {"radius": 1}, "center_of_mass": (0, 0, 1)}, "'center_of_mass' needs a 'mass'"),
        ({"sphere": {"radius": 1}, "inertia": {"ixx": 1, "iyy": 1, "izz": 1}}, "'inertia' needs a 'mass'"),
        ({"sphere": {"radius": 1}, "mass": 1, "inertia": {"ixx": 1, "iyy": 1, "izz": 3}}, "no body has the moments"),
        ({"sphere": {"radius": 1}, "mass": 1, "inertia": {"ixx": 0, "iyy": 1, "izz": 1}}, "no body has the moments"),
        (
            {"sphere": {"radius": 1}, "mass": 1, "inertia": {"ixx": 0.02, "iyy": 0.02, "izz": 0.02, "ixy": 0.05}},
            "no body has the principal moments -0.03 0.02 0.07",
        ),
        (
            {"sphere": {"radius": 1}, "mass": 1, "inertia": {"ixx": 2, "iyy": 2, "izz": 1.2, "iyz": 1.2}},
            "no body has the principal moments 0.335",
        ),
    ],
)
def test_impossible_bodies_are_refused(keys: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Body.model_validate({"name": "b", **keys})


def test_the_mass_of_several_shapes_is_spread_by_their_volumes() -> None:
    halves = tuple({"box": (1, 1, 1), "pose": {"x": x}} for x in (-0.5, 0.5))
    whole = Body.model_validate({"name": "w", "shapes": ({"box": (2, 1, 1)},), "mass": 6})
    both = Body.model_validate({"name": "b", "shapes": halves, "mass": 6})

    one, other = (mass_properties_of(body, body.parts()) for body in (whole, both))
    assert other.centre_xyz == pytest.approx(one.centre_xyz)
    assert np.diag(one.inertia) == pytest.approx([1.0, 2.5, 2.5])
    assert other.inertia == pytest.approx(one.inertia)


def test_a_turned_cylinder_has_the_inertia_of_its_hull() -> None:
    turned = Pose((0.1, 0.2, 0.3), quaternion_from_rpy(0.3, 0.7, -0.4))
    angles = np.linspace(0, 2 * math.pi, 400, endpoint=False)
    rim = [(0.2 * math.cos(angle), 0.2 * math.sin(angle), z) for angle in angles for z in (-0.4, 0.4)]
    body = Body.model_validate({"name": "c", "shapes": ({"sphere": {"radius": 1}},), "mass": 2})

    exact = mass_properties_of(body, [moved(CylinderPart(0.2, 0.8), turned)])
    sampled = mass_properties_of(body, [moved(HullPart(tuple(rim)), turned)])

    assert exact.centre_xyz == pytest.approx(sampled.centre_xyz)
    assert exact.inertia == pytest.approx(sampled.inertia, rel=1e-3)


def test_stated_mass_properties_replace_those_of_uniform_density() -> None:
    inertia = {"ixx": 0.1, "iyy": 0.2, "izz": 0.25, "ixy": 0.01}
    body = Body.model_validate({**TABLE, "mass": 4, "center_of_mass": (0, 0, 0.1), "inertia": inertia})

    found = mass_properties_of(body, body.parts())

    assert body.has_own_inertia
    assert (found.mass, found.centre_xyz) == (4, (0, 0, 0.1))
    assert found.inertia.tolist() == [[0.1, 0.01, 0.0], [0.01, 0.2, 0.0], [0.0, 0.0, 0.25]]


def test_a_part_moves_with_its_frame() -> None:
    turned = Pose((1.0, 0.0, 0.0), quaternion_from_rpy(0, 0, math.pi / 2))

    ball = moved(SpherePart(0.1, Pose((1.0, 0.0, 0.0))), turned)
    hull = moved(HullPart(((1.0, 0.0, 0.0),)), turned)

    assert isinstance(ball, SpherePart)
    assert ball.pose.position_xyz == pytest.approx((1, 1, 0))
    assert isinstance(hull, HullPart)
    assert hull.points_xyz[0] == pytest.approx((1, 1, 0))
