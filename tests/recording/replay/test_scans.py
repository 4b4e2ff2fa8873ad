"""The scans of a replay: what is read is what was stored, to a centimetre, and long runs have fewer of them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from sim_action.recording.replay.scans import MAX_RANGES, ScanData, stored_scans, thinning
from sim_action.sensors import ReadingLog
from tests.outcomes import like
from tests.recording.replay import logs

LINKS = {"base_footprint": 0, "base_scan": 1}
RATE = 240.0


def stored(*several: ReadingLog, end: float = 100.0) -> tuple[ScanData, ...]:
    return stored_scans({log.mounted.name: log for log in several}, LINKS, "base_footprint", end, RATE)


def test_scans_are_stored_to_a_centimetre() -> None:
    (found,) = stored(logs.lidar("front", 3, lambda time: [1.0 + time, math.inf, -math.inf, 2.345], rate=5.0))
    assert (found.sensor, found.link, found.rays, found.count) == ("front", 0, 4, 3)
    assert (found.every_scan, found.every_ray) == (1, 1)
    assert found.is_whole
    np.testing.assert_allclose(found.time.decoded(3), [0.0, 0.2, 0.4])
    expected = [[1.0 + time, math.inf, -math.inf, 2.345] for time in (0.0, 0.2, 0.4)]
    np.testing.assert_allclose(found.decoded(), expected, atol=0.0051)
    assert ScanData.model_validate_json(found.model_dump_json()) == found


def test_a_fast_lidar_keeps_five_scans_per_second() -> None:
    (found,) = stored(logs.lidar("front", 41, lambda _: [1.0], rate=40.0))
    assert found.every_scan == 8
    np.testing.assert_allclose(found.time.decoded(found.count), [0.0, 0.2, 0.4, 0.6, 0.8, 1.0])


def test_scans_after_the_end_and_other_sensors_are_left_out() -> None:
    (found,) = stored(logs.lidar("front", 10, lambda _: [1.0], rate=5.0), logs.bumper("bumper", {}), end=0.4)
    assert found.count == 3


@pytest.mark.parametrize(
    ("rate", "scans", "rays", "budget", "expected"),
    [
        (5.0, 50, 360, MAX_RANGES, (1, 1)),
        (10.0, 100, 360, MAX_RANGES, (2, 1)),
        (10.0, 100, 1080, MAX_RANGES, (2, 3)),
        (10.0, 6_000, 360, MAX_RANGES, (8, 1)),
        # Below one scan per second, rays are left out.
        (10.0, 20_000, 360, MAX_RANGES, (10, 3)),
        (1.0, 10_000, 1, 5_000, (2, 1)),
    ],
)
def test_scans_are_left_out_before_rays(
    rate: float, scans: int, rays: int, budget: int, expected: tuple[int, int]
) -> None:
    assert thinning(rate, scans, rays, budget) == expected
    every_scan, every_ray = expected
    assert -(-scans // every_scan) * -(-rays // every_ray) <= budget


@pytest.mark.parametrize(
    "change",
    [
        {"rays": 0},
        {"rays": 361},
        {"ranges": [1] * (MAX_RANGES + 1)},
        {"ranges": [1e9]},
        {"ranges": [300_000]},
        {"scale": 0},
        {"pose": [0, 0, 0]},
        {"range": math.inf},
        {"every_scan": 0},
        {"more": 1},
    ],
)
def test_what_no_lidar_stores_is_refused(change: dict[str, Any]) -> None:
    (found,) = stored(logs.lidar("front", 1, lambda _: [1.0]))
    with pytest.raises(ValidationError):
        ScanData.model_validate(found.model_dump() | change)


@pytest.mark.parametrize("change", [{"ranges": (1, 2)}, {"rays": 2}])
def test_scans_that_are_not_complete_are_noticed(change: dict[str, Any]) -> None:
    (found,) = stored(logs.lidar("front", 1, lambda _: [1.0]))
    assert not like(found, **change).is_whole
