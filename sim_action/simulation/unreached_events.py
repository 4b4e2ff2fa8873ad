"""What was to happen in the world, but the run was over before: without it, a verdict says less than it seems to."""

from __future__ import annotations

from collections.abc import Iterator

from sim_action.world import World


def missed(world: World, end: float) -> Iterator[str]:
    """One note for each disturbance, appearance and path that a run of `end` s of sim time did not come to."""
    for what, begins in _events(world):
        if begins >= end:
            yield f"the run was over at {end:.4g} s, and {what} at {begins:g} s: it never came to that"


def _events(world: World) -> Iterator[tuple[str, float]]:
    for body in world.objects:
        if body.appears is not None:
            yield f"body '{body.name}' appears", body.appears
        if body.path:
            yield f"body '{body.name}' begins to move", body.path[0].at
    for index, disturbance in enumerate(world.disturbances):
        yield f"world.disturbances[{index}] begins", disturbance.at
