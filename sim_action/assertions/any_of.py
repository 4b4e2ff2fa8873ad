"""`any_of: [...]`: one of several assertions must hold."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from sim_action.assertions import Monitor
from sim_action.assertions.combined import Combination
from sim_action.assertions.several import Several
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation


class AnyOf(Several):
    """One assertion of several must hold, whichever it is.

    It is a goal if one of them is: the run waits for the first that comes true, or else for its end, and what is
    then not broken holds. Of invariants alone it is an invariant, broken when the last of them is. Margin, limit
    and time are those of the assertion that decides, which the message names: of those that hold, or of all if
    none does, the one with the greatest margin, if all are measured in the same unit; else, of those that hold,
    the first. `after`, `before`, `name` and `severity` stand beside `any_of`.
    """

    key: ClassVar[str] = "any_of"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        return Combination.of(self.parts, scene, start, every=False)
