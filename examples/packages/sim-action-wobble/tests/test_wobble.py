"""The rules of sim-action for the parts of packages. Install the package first: pip install -e ."""

from __future__ import annotations

from pathlib import Path

from sim_action_wobble import Inclinometer, Sway, Wobble

from sim_action import load
from sim_action.testing import check_assertion, check_command, check_sensor

(DRIVES,) = load(Path(__file__).parents[1] / "straight_line.sim.yml")


def test_wobble() -> None:
    """The assertion passes in the scenario as it stands, and fails with a stricter limit."""
    check_assertion(Wobble(at_most=0.1), passes=DRIVES, fails=DRIVES.changed({"expect.1.wobble.at_most": "0.0001 deg"}))


def test_sway() -> None:
    """The command source gives the same commands in each run."""
    swaying = DRIVES.changed({"commands": {"sway": 0.2}, "expect.0": "no_collision"})
    check_command(Sway(sway=0.2), scenario=swaying)


def test_inclinometer() -> None:
    """The sensor gives readings of the stated shape."""
    check_sensor(Inclinometer(noise=0.01), scenario=DRIVES)
