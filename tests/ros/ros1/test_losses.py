"""Losses as failures and as warnings."""

from __future__ import annotations

from sim_action.core.errors import Location
from sim_action.ros.ros1.losses import loss_failures, loss_warnings
from sim_action.world.world_files.losses import Loss

HERE = Location("a.launch")
WALL = Loss(message="the wall is left out", location=Location("a.world", 3))


def test_a_loss_is_a_failure_with_its_place_and_the_option() -> None:
    (failure,) = loss_failures([WALL, WALL])

    assert (failure.kind, failure.location) == ("invalid", Location("a.world", 3))
    assert failure.message == "the wall is left out; to run without it: --allow-losses"


def test_an_allowed_loss_is_a_warning_with_a_place() -> None:
    placed, unplaced = loss_warnings([WALL, Loss(message="a\nplugin")], HERE)

    assert str(placed) == "the wall is left out [not-simulated]"
    assert placed.location == Location("a.world", 3)
    assert (unplaced.message, unplaced.location) == ("a\\nplugin", HERE)


def test_many_losses_are_counted() -> None:
    losses = [Loss(message=f"part {number}") for number in range(30)]

    assert len(loss_failures(losses)) == 21
    assert loss_warnings(losses, HERE)[-1].message == "10 more parts of the launch"
