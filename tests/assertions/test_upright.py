"""The robot does not tip over."""

from __future__ import annotations

import math

import pytest
from pydantic import ValidationError

from sim_action.assertions.upright import Upright
from tests.traces import judged, trace

SWAYING = trace([1.0, 2.0, 3.0], roll=[0.0, -math.radians(15), math.radians(30)], yaw=[0.0, 1.0, 2.0])


def test_a_tilt_within_the_limit_passes_with_its_worst_moment() -> None:
    verdict = judged(Upright(max_tilt=math.radians(40)), SWAYING)
    assert verdict.passed
    assert verdict.measured == pytest.approx(math.radians(30))
    assert verdict.margin == pytest.approx(math.radians(10))
    assert (verdict.time, verdict.unit) == (3.0, "rad")
    assert verdict.message == "tilted by at most 30 deg, limit 40 deg"


def test_the_first_moment_beyond_the_limit_breaks_it() -> None:
    verdict = judged(Upright(max_tilt=math.radians(10)), SWAYING)
    assert not verdict.passed
    assert verdict.time == 2.0
    assert verdict.margin == pytest.approx(math.radians(-5))
    assert verdict.message == "tilted by 15 deg at 2.00 s, more than 10 deg"


def test_turning_on_the_spot_is_no_tilt_and_lying_on_the_back_one_of_half_a_turn() -> None:
    assert judged(Upright(), trace([1.0], yaw=[3.0])).measured == pytest.approx(0.0, abs=1e-7)
    assert judged(Upright(), trace([1.0], roll=[math.pi])).measured == pytest.approx(math.pi)


@pytest.mark.parametrize("tilt", [0, "-5 deg", "5 m"])
def test_a_limit_is_an_angle_greater_than_zero_20_degrees_by_default(tilt: object) -> None:
    assert Upright().title == "upright within 20 deg"
    with pytest.raises(ValidationError):
        Upright.model_validate({"max_tilt": tilt})
