"""Whether a body that appears finds its place free: what is inside something is thrown out of it, as at the start."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from sim_action.core import units
from sim_action.core.errors import RunError
from sim_action.engines import Backend
from sim_action.scenario.clash_checks import DEPTH
from sim_action.scenario.model import Scenario


@dataclass(frozen=True, slots=True)
class Arrivals:
    """Names of bodies, by the step at which they appear; and the place of each among the world's objects."""

    names: dict[int, tuple[str, ...]]
    indices: dict[str, int]

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """None in most scenarios."""
        names: dict[int, tuple[str, ...]] = {}
        for body in scenario.world.objects:
            if body.appears is not None:
                step = scenario.steps(body.appears)
                names[step] = (*names.get(step, ()), body.name)
        return cls(names, {body.name: index for index, body in enumerate(scenario.world.objects)})

    def next(self, step: int, until: int) -> int:
        """The first step after `step` at which something appears, or `until` if that comes first."""
        return min((arrival for arrival in self.names if step < arrival < until), default=until)

    def refuse_blocked(self, step: int, rate: float, backend: Backend) -> None:
        """Raises RunError if what has appeared at this step is inside the robot, or inside what else moves."""
        arrived = self.names.get(step, ())
        if not arrived:
            return
        found = [(body, f"the robot's link '{link}'", depth) for link, body, depth in backend.overlaps()]
        for one, other, depth in backend.clashes():
            found += [(one, f"'{other}'", depth), (other, f"'{one}'", depth)]
        blocked = [each for each in found if each[0] in arrived and each[2] > DEPTH]
        if blocked:
            body, inside, depth = max(blocked, key=lambda each: each[2])
            raise RunError(
                f"body '{body}' appears at {step / rate:.4g} s, {units.display(depth, 'm')} deep in {inside}, and one "
                "would throw the other away; let it appear at another place or time",
                keys=("world", "objects", self.indices[body], "appears"),
            )
