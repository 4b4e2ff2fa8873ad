"""`all_of: [...]`: several assertions must hold."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from sim_action.assertions import Monitor
from sim_action.assertions.combined import Combination
from sim_action.assertions.several import Several
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation


class AllOf(Several):
    """Several assertions must hold, all of them.

    Beside `expect` itself, which asks the same of its entries, it is of use inside of `any_of` and `not`, and
    where several have one `name`, `after`, `before` and `severity`. It is a goal if one of them is; it is broken
    as soon as one of them is. Margin, limit and time are those of the assertion that decides, which the message
    names: the one with the least margin, if all are measured in the same unit; else the last that came true, or
    the first that does not hold.
    """

    key: ClassVar[str] = "all_of"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        return Combination.of(self.parts, scene, start, every=True)
