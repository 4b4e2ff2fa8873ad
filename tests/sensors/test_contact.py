"""Contact sensors: of their own link alone."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sim_action.core.geometry import Pose
from sim_action.sensors import Mount
from sim_action.sensors.contact import ContactSensor
from sim_action.state.observation import Observation
from sim_action.state.readings import ContactReading
from tests.sensors.stubs import NO_PROBE, sight_of
from tests.traces import START, contact, scene

TOUCHES = (contact(1.0, "wall", force=2.0), contact(1.0, "ball", force=3.0), contact(1.0, "ground", link="other"))


@pytest.mark.parametrize(
    ("seen", "told"),
    [
        (START, (False, 0.0, ())),
        (replace(START, contacts=TOUCHES), (True, 5.0, ("ball", "wall"))),
        (replace(START, contacts=TOUCHES[2:]), (False, 0.0, ())),
    ],
)
def test_it_adds_up_what_touches_its_link(seen: Observation, told: tuple[bool, float, tuple[str, ...]]) -> None:
    there = scene()
    measure = ContactSensor().open(Mount(there, "base_footprint", Pose(), 10.0, there.generator("x")))
    assert measure(sight_of(replace(seen, time=1.0), NO_PROBE)) == ContactReading(1.0, *told)
