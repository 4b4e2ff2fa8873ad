"""Write the table of docs/models/robots.md with new measurements: `make robots`.

With `--check`, nothing is measured or written; the exit code is 1 if anything but the measured times is stale.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from sim_action.core.errors import RefusedModel
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.reading.loading import load_model
from tools.bench.robots import OUR_ROBOTS, REFUSED, ROBOTS, WORKSPACE, KnownRobot
from tools.bench.step_cost import StepCost, step_cost
from tools.docs.generate import BLOCK
from tools.docs.generators.markdown import table
from tools.docs.survey import rules_cell

PAGE: Final = Path(__file__).resolve().parents[2] / "docs/models/robots.md"
HEAD: Final = ("robot", "other keys of `robot:`", "mass", "joints", "findings", "µs a step", "ratio")
# What differs from one measurement to the next: the last two cells of a row, if they hold figures.
_FIGURES: Final = re.compile(r"\| \d+ / \d+ \| \d+\.\d\d \|$", re.MULTILINE)
_NO_FIGURES: Final = "| # / # | # |"


def rows(costs: dict[str, StepCost]) -> Iterator[tuple[str, ...]]:
    """Yield a row for each robot; without its cost, the times stay open."""
    for entry in (*OUR_ROBOTS, *ROBOTS):
        model = load_model(entry.robot, WORKSPACE)
        yield (*_facts(entry, model), *_figures(costs.get(entry.name)))
    yield (f"{REFUSED.name}<br>`{REFUSED.model}`", "refused", "", "", _refusal(REFUSED), "", "")


def _facts(entry: KnownRobot, model: RobotModel) -> tuple[str, ...]:
    return (
        f"{entry.name}<br>`{entry.model}`",
        "<br>".join(_keys(entry)) or "none",
        _mass(model),
        f"{len(model.joints)}, {len(model.moving_joints)} move",
        rules_cell(Counter(finding.rule for finding in model.findings)),
    )


def _keys(entry: KnownRobot) -> Iterator[str]:
    """Yield the keys that the model needs to be accepted; paths are relative to pybullet_data."""
    if entry.robot.allow:
        yield f"`allow: [{', '.join(entry.robot.allow)}]`"
    if entry.robot.base == "fixed":
        yield "`base: fixed`"


def _mass(model: RobotModel) -> str:
    masses = ET.fromstring(model.urdf).iterfind("link/inertial/mass")  # noqa: S314 - written by sim-action
    negligible = sum(float(mass.attrib["value"]) for mass in masses) - model.mass
    return f"{model.mass:.4g} kg" + (f" + {negligible * 1000:.2g} g" if negligible > 1e-9 else "")


def _refusal(entry: KnownRobot) -> str:
    try:
        load_model(entry.robot, WORKSPACE)
    except RefusedModel as refused:
        (problem,) = refused.problems
        return f"{Path(problem.location.file).name}:{problem.location.line}: {problem.message}"
    raise AssertionError(f"{entry.name} is no longer refused")


def _figures(cost: StepCost | None) -> tuple[str, str]:
    return ("# / #", "#") if cost is None else (f"{cost.ours:.0f} / {cost.raw:.0f}", f"{cost.ours / cost.raw:.2f}")


def page(costs: dict[str, StepCost]) -> str:
    """Return the text that the file should hold."""
    return BLOCK.sub(lambda m: f"{m[1]}{table(HEAD, rows(costs))}{m[4]}", PAGE.read_text(encoding="utf-8"))


def without_figures(text: str) -> str:
    """Return the text with open times; a row without times stays different."""
    return _FIGURES.sub(_NO_FIGURES, text)


def main() -> None:
    """Write the table, or with `--check` exit with 1 if it is stale."""
    if "--check" in sys.argv:
        sys.exit(
            "stale: docs/models/robots.md; run: make robots"
            if without_figures(PAGE.read_text("utf-8")) != page({})
            else 0
        )
    PAGE.write_text(page({entry.name: step_cost(entry) for entry in (*OUR_ROBOTS, *ROBOTS)}), encoding="utf-8")


if __name__ == "__main__":
    main()
