"""Other runs of a scenario, drawn as ghosts in its player: which ones there are, and where their motions part.

A ghost has its motion and its signals. Its contacts and marks are not drawn.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sim_action.core.records import dataclass, field
from sim_action.recording.replay.replay_data import Replay
from sim_action.reports.escaping import one_line
from sim_action.reports.html.parting import Parting, Tolerance, parting, same_motion_text, with_zeros
from sim_action.reports.html.replay_blocks import MAX_REPLAY_BYTES, PackedReplay, ReplayBlocks
from sim_action.results.outcome import Outcome


@dataclass(frozen=True, slots=True)
class Ghost:
    """A run that can be drawn in the player of another one.

    Attributes:
        label: its name in the choice and in addresses.
        block: the element id of its packed replay.
        parting: the moment at which the two part, or one of them ends; None if their motions are the same to the end.
        alike: the sentence for a pair that does not part.
        is_shown: True if it is drawn from the start.
    """

    label: str
    block: str
    parting: Parting | None
    alike: str
    is_shown: bool = False

    def entry(self, blocks: ReplayBlocks) -> dict[str, object]:
        """Return the data for the script of the page."""
        parts = self.parting
        return {
            "label": one_line(self.label),
            "replay": self.block if self.block in blocks.blocks else None,
            "parting": None
            if parts is None
            else {"time": parts.time, "words": f"{parts.told[0].upper()}{parts.told[1:]}"},
            "alike": self.alike,
            "shown": self.is_shown,
        }


def ghost(
    label: str, block: str, ours: Replay, theirs: Replay, tolerance: Tolerance | None = None, *, is_shown: bool = False
) -> Ghost:
    """Return the ghost of `theirs` in the player of `ours`."""
    tolerance = tolerance or Tolerance()
    return Ghost(label, block, parting(ours, theirs, tolerance), same_motion_text(ours, theirs, tolerance), is_shown)


def motion_of(replay: Replay, ours: Replay) -> Replay:
    """Return what a ghost of `ours` needs of a replay."""
    return Replay.model_construct(
        version=replay.version,
        scene=replay.scene,
        joint_names=replay.joint_names,
        frames=replay.frames,
        signals=replay.signals,
        channels=with_zeros(replay, ours).channels,
    )


@dataclass(slots=True)
class WaitingGhosts:
    """Packed ghosts that get the room which the replays of the page leave."""

    waiting: list[tuple[str, PackedReplay]] = field(default_factory=list)
    size: int = 0

    def add(self, identity: str, replay: Replay, ours: Replay) -> None:
        """Keep a ghost of `ours` for later, unless the ghosts before it already fill a page."""
        if self.size < MAX_REPLAY_BYTES:
            packed = PackedReplay.of(motion_of(replay, ours))
            self.waiting.append((identity, packed))
            self.size += len(packed.block)

    def settle(self, blocks: ReplayBlocks) -> None:
        """Add the ghosts that fit to the page."""
        for identity, packed in self.waiting:
            blocks.put(identity, packed)
        self.waiting.clear()
        self.size = 0


def engine_pairs(outcomes: Sequence[Outcome]) -> Iterator[tuple[Outcome, Outcome]]:
    """Yield the pairs of runs of one scenario in two engines; each run is named after its engine."""
    known: dict[tuple[str, int | None, str], list[Outcome]] = {}
    for outcome in outcomes:
        if outcome.engine is not None and outcome.name.endswith("]"):
            name = outcome.name.rpartition(" [")[0]
            known.setdefault((outcome.file, outcome.number, name), []).append(outcome)
    for several in known.values():
        for place, one in enumerate(several):
            yield from ((one, other) for other in several[place + 1 :] if other.engine != one.engine)
