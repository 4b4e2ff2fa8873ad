"""What becomes of what was let go, as an engine gets to see it."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from sim_action.robot.urdf import read_urdf
from tests.robot.bad_models import GOOD


def links(folder: Path, text: str, *allow: str) -> dict[str, ET.Element]:
    path = folder / "robot.urdf"
    path.write_text(text, encoding="utf-8")
    return {link.attrib["name"]: link for link in ET.fromstring(read_urdf(path, allow=allow).urdf).iter("link")}


def inertia(link: ET.Element) -> tuple[float, float, float, float]:
    mass, moments = link.find("inertial/mass"), link.find("inertial/inertia")
    assert mass is not None
    assert moments is not None
    ixx, iyy, izz = (float(moments.attrib[name]) for name in ("ixx", "iyy", "izz"))
    return float(mass.attrib["value"]), ixx, iyy, izz


def test_what_is_good_stays_as_it_is(tmp_path: Path) -> None:
    assert inertia(links(tmp_path, GOOD)["base"]) == (2.0, 1.0, 1.0, 1.0)


def test_a_link_without_inertial_weighs_next_to_nothing(tmp_path: Path) -> None:
    start = GOOD.index("<inertial>", GOOD.index('name="upper"'))
    end = GOOD.index("</inertial>", start) + len("</inertial>")
    mass, *moments = inertia(links(tmp_path, GOOD[:start] + GOOD[end:])["upper"])
    assert mass == pytest.approx(2e-4)
    assert moments == [pytest.approx(0.4 * 2e-4 * 0.05**2)] * 3


@pytest.mark.parametrize(("link", "mass"), [("upper", 2e-4), ("base", 0.0)])
def test_a_mass_of_zero_counts_as_left_out_but_for_the_base(link: str, mass: float, tmp_path: Path) -> None:
    place = GOOD.index("<mass", GOOD.index(f'name="{link}"'))
    text = GOOD[:place] + GOOD[place:].replace(GOOD[place : GOOD.index("/>", place)], '<mass value="0"', 1)
    assert inertia(links(tmp_path, text, "zero-mass")[link])[0] == pytest.approx(mass)


@pytest.mark.parametrize("moment", ["0", "-1"])
def test_a_body_without_a_moment_above_0_is_a_ball(moment: str, tmp_path: Path) -> None:
    text = GOOD
    for name in ("ixx", "iyy", "izz"):
        text = text.replace(f'{name}="1"', f'{name}="{moment}"', 1)
    assert inertia(links(tmp_path, text, "impossible-inertia")["base"]) == pytest.approx((2.0, 2e-3, 2e-3, 2e-3))


@pytest.mark.parametrize(("least", "added"), [("0", 0.0), ("-0.25", 0.5)])
def test_a_body_that_would_turn_without_end_about_one_axis_keeps_its_other_moments(
    least: str, added: float, tmp_path: Path
) -> None:
    text = GOOD.replace('ixx="1"', f'ixx="{least}"', 1)
    _, ixx, iyy, izz = inertia(links(tmp_path, text, "impossible-inertia")["base"])
    assert (ixx, iyy, izz) == pytest.approx((float(least) + added, 1 + added, 1 + added), abs=1e-5)
    assert ixx > 0
    assert max(iyy, izz) < ixx + min(iyy, izz)


def test_an_expression_that_was_let_go_is_left_out(tmp_path: Path) -> None:
    link = links(tmp_path, GOOD.replace("1 2 3", "${x} 2 3"), "unexpanded-expression")["base"]
    assert link.find("collision") is not None
    assert link.find("collision/origin") is None


@pytest.mark.parametrize("greatest", ["2", "2.001", "1.9999999"])
def test_a_flat_plate_turns_as_one(greatest: str, tmp_path: Path) -> None:
    # The engine takes inertia away from what is off by a rounding error.
    text = GOOD.replace('izz="1"', f'izz="{greatest}"', 1)
    _, ixx, iyy, izz = inertia(links(tmp_path, text)["base"])
    assert (ixx, iyy, izz) == pytest.approx((1.0, 1.0, float(greatest)), rel=2e-3)
    assert izz < ixx + iyy


def test_an_inertia_that_no_body_can_have_and_was_let_go_is_made_one(tmp_path: Path) -> None:
    _, ixx, iyy, izz = inertia(links(tmp_path, GOOD.replace('izz="1"', 'izz="5"', 1), "impossible-inertia")["base"])
    assert (ixx, iyy, izz) == pytest.approx((4, 4, 8), rel=1e-5)
    assert izz < ixx + iyy


def test_a_joint_that_was_let_go_as_it_mimics_itself_moves_by_itself_however_often_it_says_so(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(GOOD.replace("</joint>", '<mimic joint="shoulder"/><mimic joint="shoulder"/></joint>'))
    assert read_urdf(path, allow=["bad-mimic"]).joints[0].mimic is None
