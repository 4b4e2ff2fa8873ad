"""The change of a scenario since the run of `--against`: a kind to sort by, and words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from sim_action.core.records import dataclass

if TYPE_CHECKING:
    from sim_action.results.comparison import ChangeKind

    ScenarioChangeKind = ChangeKind | Literal["less margin", "slower", "weaker", "moves differently", "unchanged"]
    """The kind of change of a scenario or gate; the last five are those whose verdict is the one of before.

    - less margin: a margin, or that of the runs of a gate, is less than half of the one of before.
    - slower: the real-time factor is less than half of the one of before.
    - weaker: an expectation is gone, allows more, or no longer holds as a warning; or the pass rate of a gate fell.
    """


@dataclass(frozen=True, slots=True)
class ScenarioChange:
    """The change of a scenario or gate.

    Attributes:
        words: what changed, such as "newly fails; before: came true at 5.75 s".
        limit: the limits now and before of the expectation that failed; empty if it fails with both.
        world: how the scene of its replay differs, such as "pallet is new"; empty if it is the same or not known.
        command: the first command that differs before the motions part, with both values and its time; empty if the
            commands are the same, None if that is not known, or if the motions do not part.
    """

    kind: ScenarioChangeKind
    words: str
    limit: str = ""
    world: str = ""
    command: str | None = None

    @property
    def gist(self) -> str:
        """The change in a few words, for a table; empty if nothing changed."""
        kind = "" if self.kind == "unchanged" else self.kind
        command = "other commands" if self.command else ""
        return "; ".join(part for part in (kind, self.limit, self.world, command) if part)
