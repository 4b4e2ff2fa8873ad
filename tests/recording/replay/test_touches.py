"""Contacts that follow each other are one, and the strongest_touches are kept."""

from __future__ import annotations

import pytest

from sim_action.recording.replay.build import joined_touches, strongest_touches
from sim_action.recording.replay.columns import Column
from sim_action.recording.replay.replay_data import MAX_CONTACTS
from sim_action.state.observation import Contact
from tests.outcomes import like
from tests.traces import contact

RATE = 240


def test_steps_of_one_pair_are_one_contact_with_its_largest_mean_force_and_its_impulse() -> None:
    steps = [contact(1.0 + step / RATE, force=12.0 if 40 <= step < 60 else 6.0) for step in range(100)]
    (touch,) = joined_touches(steps)
    assert (touch.first, touch.until) == (steps[0], steps[-1].time)
    assert (touch.force(RATE), touch.impulse(RATE)) == pytest.approx((12.0, (80 * 6 + 20 * 12) / RATE))


@pytest.mark.parametrize("rate", [120, 240, 960])
def test_the_force_of_an_impact_does_not_depend_on_the_rate(rate: int) -> None:
    (touch,) = joined_touches([contact(1.0, force=0.25 * rate), contact(1.0, force=0.25 * rate)])
    assert (touch.force(rate), touch.impulse(rate)) == pytest.approx((10.0, 0.5))


def test_a_step_longer_than_the_window_is_its_own_mean() -> None:
    (touch,) = joined_touches([contact(1.0, force=4.0), contact(13 / 12, force=6.0)])
    assert touch.force(12) == pytest.approx(6.0)


def test_points_of_a_step_add_up() -> None:
    points = [contact(1.0, force=30.0), contact(1.0, force=40.0), contact(1.01, force=50.0), contact(1.02, force=5.0)]
    assert [touch.force(100) for touch in joined_touches(points)] == pytest.approx([(70 + 50 + 5) / 5])


def test_a_pair_that_lets_go_touches_again() -> None:
    assert [touch.until for touch in joined_touches([contact(1.0), contact(1.05), contact(1.5)])] == [1.05, 1.5]


def test_pairs_are_told_apart() -> None:
    found = joined_touches(
        [contact(1.0), contact(1.0, body="ball"), contact(1.01), contact(1.01, link="caster_back_link")]
    )
    assert [(touch.first.link, touch.first.body) for touch in found] == [
        ("base_footprint", "wall"),
        ("base_footprint", "ball"),
        ("caster_back_link", "wall"),
    ]


def test_of_many_the_strongest_are_kept_in_the_order_of_time() -> None:
    many = [contact(float(number), force=float(number % 100)) for number in range(3 * MAX_CONTACTS)]
    kept, left_out = strongest_touches(joined_touches(many), {"base_footprint": 0}, {"wall": 0}, RATE)
    assert (len(kept), left_out) == (MAX_CONTACTS, 2 * MAX_CONTACTS)
    assert min(touch.force or 0.0 for touch in kept) >= 66 / 12
    assert [touch.time for touch in kept] == sorted(touch.time for touch in kept)


def test_what_touches_something_unknown_is_passed_over() -> None:
    assert strongest_touches(
        joined_touches([contact(1.0, body="ground")]), {"base_footprint": 0}, {"wall": 0}, RATE
    ) == (
        (),
        0,
    )


def test_a_contact_without_a_force_is_kept_before_weak_ones() -> None:
    stuck = contact(0.5, force=0.0)._replace(has_force=False)
    many = [contact(float(number), force=float(number)) for number in range(1, 3 * MAX_CONTACTS)]
    kept, _ = strongest_touches(joined_touches([stuck, *many]), {"base_footprint": 0}, {"wall": 0}, RATE)
    assert (kept[0].time, kept[0].force) == (0.5, None)
    assert all(touch.force is not None for touch in kept[1:])


def test_the_force_on_the_link_has_a_direction_and_a_course() -> None:
    steps = [
        contact(step / RATE, force=6.0 if step < 8 else 12.0)._replace(normal_xyz=(0.0, -0.6, 0.8))
        for step in range(16)
    ]
    ((found,), _) = strongest_touches(joined_touches(steps), {"base_footprint": 0}, {"wall": 0}, RATE)
    assert found.normal == pytest.approx((0.0, -0.6, 0.8))
    assert found.period == pytest.approx(1 / 30)
    assert found.forces == Column(scale=0.01, first=600, deltas=(600,))


def test_a_long_contact_has_fewer_forces() -> None:
    steps = [contact(step / RATE)._replace(normal_xyz=(1.0, 0.0, 0.0)) for step in range(100 * RATE)]
    ((found,), _) = strongest_touches(joined_touches(steps), {"base_footprint": 0}, {"wall": 0}, RATE)
    assert found.period == pytest.approx(80 / RATE)
    assert found.forces is not None
    # Each period has as many steps, so a constant force is a straight line.
    assert found.forces.decoded(300) == pytest.approx([12.5] * 300)
    assert found.forces.deltas == ()


def test_a_contact_without_a_direction_has_no_course() -> None:
    ((found,), _) = strongest_touches(joined_touches([contact(1.0)]), {"base_footprint": 0}, {"wall": 0}, RATE)
    assert (found.normal, found.period, found.forces, found.places) == (None, None, None, None)


def test_the_place_of_a_force_moves_with_it() -> None:
    def at(step: int, x: float, y: float, force: float) -> Contact:
        return contact(step / RATE, force=force)._replace(position_xyz=(x, y, 0.1), normal_xyz=(1.0, 0.0, 0.0))

    # Two points of each step, one with three times the force of the other; in between, a period without contact.
    steps = [at(step, x, y, 1.0 + y) for step, x in ((0, 1.0), (1, 1.2), (24, 4.0)) for y in (0.0, 2.0)]
    ((found,), _) = strongest_touches(joined_touches(steps), {"base_footprint": 0}, {"wall": 0}, RATE)
    assert found.places is not None
    x, y, z = (column.decoded(4) for column in found.places)
    assert x == pytest.approx([1.1, 2.067, 3.033, 4.0], abs=1e-3)
    assert (y.tolist(), z.tolist()) == ([1.5] * 4, [0.1] * 4)
    assert found.is_whole
    assert not like(found, period=None).is_whole
    short = like(found.places[0], deltas=(1,))
    assert not like(found, places=(short, *found.places[1:])).is_whole
