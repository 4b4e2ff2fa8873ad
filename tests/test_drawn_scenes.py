"""A few of the drawn scenes of `make soak`."""

from __future__ import annotations

import random

import pytest

from sim_action.engines import ENGINES
from tests.drawn_scenes import DrawnScene, drawn_scene, failures
from tests.integration.engines import on_every_engine


def at_fault(engine: str, drawn: DrawnScene) -> set[str]:
    pytest.importorskip(ENGINES[engine].package, reason=f"{engine} is not installed")
    return {text.split(":")[0] for text in failures(engine, drawn)}


@on_every_engine
@pytest.mark.parametrize("number", range(4))
def test_drawn_scenes_hold(engine: str, number: int) -> None:
    assert at_fault(engine, drawn_scene(random.Random(f"7-{number}"))) == set()


def test_a_body_without_a_place_between_the_others_stands_beside_them() -> None:
    drawn = drawn_scene(random.Random("1-1651"))
    assert max(abs(at) for body in drawn.bodies for at in body.position[:2]) > 0.5
