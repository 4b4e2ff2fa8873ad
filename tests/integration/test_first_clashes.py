"""Bodies that are told to begin in each other before anything runs are those that the engines find in each other."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any, Final

import pytest

from sim_action.scenario.body_overlaps import clashes
from sim_action.scenario.stage import DEPTH
from sim_action.world import Body, World
from tests.integration.engines import at, on_every_engine, running, scene_of
from tests.robot.bad_models import GOOD

pytestmark = on_every_engine

SHAPES: Final[tuple[dict[str, Any], ...]] = (
    {"box": (0.2, 0.3, 0.4)},
    {"sphere": {"radius": 0.15}},
    {"cylinder": {"radius": 0.12, "height": 0.3}},
)
_ROUNDING: Final = 0.002  # in m: engines round edges, and tell of two boxes the depth of single points


def pair(seed: int) -> World:
    """Two bodies, of which the first moves, about as far from each other as they are large."""
    drawn = random.Random(seed)
    objects = []
    for name, mass in (("one", 1.0), ("other", None)):
        pose = {axis: drawn.uniform(-0.2, 0.2) + (2.0 if axis == "z" else 5.0) for axis in "xyz"}
        turn = {angle: drawn.uniform(-3, 3) for angle in ("roll", "pitch", "yaw")}
        objects.append(Body.model_validate({"name": name, **drawn.choice(SHAPES), "mass": mass, "pose": pose | turn}))
    return World(objects=tuple(objects))


@pytest.mark.parametrize("seed", range(24))
def test_what_is_told_before_is_what_the_engine_finds(engine: str, seed: int, tmp_path: Path) -> None:
    world = pair(seed)
    with running(engine, scene_of(tmp_path, GOOD, at(z=1.0), world)) as backend:
        deepest = max((clash.depth for clash in backend.clashes()), default=0.0)
    told = list(clashes(world))
    if told:
        assert deepest > DEPTH - _ROUNDING
    if deepest > DEPTH + _ROUNDING and all(body.cylinder is None for body in world.objects):
        assert told
