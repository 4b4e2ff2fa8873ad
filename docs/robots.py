"""Writes the table of docs/robots.md, all measured anew: `make robots`. `--check` measures nothing."""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from bench.robots import BURGER, REFUSED, ROBOTS, WORKSPACE, KnownRobot
from bench.step_cost import StepCost, step_cost
from docs.generate import BLOCK
from docs.reference import table
from sim_action.core.errors import RefusedModel
from sim_action.robot import load_model
from sim_action.robot.robot_model import RobotModel

PAGE: Final = Path(__file__).parent / "robots.md"
HEAD: Final = ("robot", "`allow`", "mass", "joints", "findings", "µs a step", "ratio")
# What differs from one measurement to the next: the last two cells of a row, if they hold figures.
_FIGURES: Final = re.compile(r"\| \d+ / \d+ \| \d+\.\d\d \|$", re.MULTILINE)
_NO_FIGURES: Final = "| # / # | # |"


def rows(costs: dict[str, StepCost]) -> Iterator[tuple[str, ...]]:
    """One a robot; without its cost, figures are left open."""
    for known in (BURGER, *ROBOTS):
        model = load_model(known.robot, WORKSPACE)
        yield (*_facts(known, model), *_figures(costs.get(known.name)))
    yield (f"{REFUSED.name}<br>`{REFUSED.model}`", "refused", "", "", _refusal(REFUSED), "", "")


def _facts(known: KnownRobot, model: RobotModel) -> tuple[str, ...]:
    return (
        f"{known.name}<br>`{known.model}`",
        ", ".join(f"`{rule}`" for rule in known.robot.allow) or "none",
        _mass(model),
        f"{len(model.joints)}, {len(model.moving_joints)} move",
        "<br>".join(f"`{rule}` {count}" for rule, count in Counter(f.rule for f in model.findings).items()) or "none",
    )


def _mass(model: RobotModel) -> str:
    masses = ET.fromstring(model.urdf).iterfind("link/inertial/mass")  # noqa: S314 - written by sim-action
    negligible = sum(float(mass.attrib["value"]) for mass in masses) - model.mass
    return f"{model.mass:.4g} kg" + (f" + {negligible * 1000:.2g} g" if negligible > 1e-9 else "")


def _refusal(known: KnownRobot) -> str:
    try:
        load_model(known.robot, WORKSPACE)
    except RefusedModel as refused:
        (problem,) = refused.problems
        return f"{Path(problem.location.file).name}:{problem.location.line}: {problem.message}"
    raise AssertionError(f"{known.name} is not refused any more")


def _figures(cost: StepCost | None) -> tuple[str, str]:
    return ("# / #", "#") if cost is None else (f"{cost.ours:.0f} / {cost.raw:.0f}", f"{cost.ours / cost.raw:.2f}")


def page(costs: dict[str, StepCost]) -> str:
    """What the file should hold."""
    return BLOCK.sub(lambda m: f"{m[1]}{table(HEAD, rows(costs))}{m[3]}", PAGE.read_text(encoding="utf-8"))


def without_figures(text: str) -> str:
    """As `page` has it with no costs; a row whose figures are not there stays different."""
    return _FIGURES.sub(_NO_FIGURES, text)


def main() -> None:
    """Writes, or with `--check` fails if something but the figures would change."""
    if "--check" in sys.argv:
        sys.exit(
            "stale: docs/robots.md; run: make robots" if without_figures(PAGE.read_text("utf-8")) != page({}) else 0
        )
    PAGE.write_text(page({known.name: step_cost(known) for known in (BURGER, *ROBOTS)}), encoding="utf-8")


if __name__ == "__main__":
    main()
