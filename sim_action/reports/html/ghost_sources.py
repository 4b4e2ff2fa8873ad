"""The ghosts of a page: the run of `--against`, golden trajectories, the run in another engine, and a repetition."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sim_action.core.records import replace
from sim_action.recording.replay.replay_data import Replay
from sim_action.recording.replay.replay_file import ReplayReader
from sim_action.reports.html.document import Html, element, joined, text
from sim_action.reports.html.ghosts import Ghost, WaitingGhosts, engine_pairs, ghost
from sim_action.reports.html.parting import ANGLE_RAD, POSITION_M, Tolerance, commands_until
from sim_action.reports.html.replay_blocks import ReplayBlocks, replay_id, stored_replay
from sim_action.results.outcome import Outcome

if TYPE_CHECKING:
    from sim_action.reports.html.base_run import Base
    from sim_action.reports.html.changes import ScenarioChange

BASE_RUN: Final = "base run"
"""The label of the run of `--against`."""

GOLDEN: Final = "golden trajectory"

REPETITION: Final = "another repetition"
"""The label of the first of several runs that differs."""


class GhostSources:
    """Finds the ghosts of each run of a page, and keeps them until there is room."""

    def __init__(self, outcomes: Sequence[Outcome], ids: Mapping[int, str], folder: Path, base: Base | None) -> None:
        """Start with the runs of a page.

        Args:
            outcomes: all outcomes.
            ids: `id()` of an outcome -> the element id of its article.
            folder: the folder from which outcomes name their replays.
            base: the earlier run; None: there is none.
        """
        self._ids, self._folder, self._base = ids, folder, base
        self._others: dict[int, Outcome] = {}
        for one, other in engine_pairs(outcomes):
            self._others |= {id(one): other, id(other): one}
        self._readers = {kind: ReplayReader() for kind in ("base", "engine", "repetition")}
        self._waiting = WaitingGhosts()
        self.changes = {} if base is None else dict(base.changes)
        """`id()` of an outcome -> what changed since the base run; complete after `since` of all outcomes."""
        self.found: dict[str, list[Ghost]] = {}
        """Element id of an article -> its ghosts."""

    def since(self, identity: str, outcome: Outcome, replay: Replay | None) -> Html:
        """Find the ghosts of a run; return what changed since the base run, and why its motion is not drawn."""
        missing = ""
        if replay is not None:
            missing = self._find_base(identity, outcome, replay)
            self._find_golden(identity, replay)
            self._find_engine(identity, outcome, replay)
            self._find_repetition(identity, outcome, replay)
        told = self._told(identity, self.changes.get(id(outcome)))
        words = Html("; ".join(map(text, told)))
        return joined(Html(f"Since the {BASE_RUN}: {words}.") if words else "", missing)

    def _told(self, identity: str, change: ScenarioChange | None) -> Iterator[str]:
        """Yield what changed since the base run, the causes first."""
        parts = [each.parting for each in self.found.get(identity, ()) if each.label == BASE_RUN and each.parting]
        same = ""
        if change is not None:
            if change.world:
                yield Html(f"in its world, {element('b', change.world)}")
            if change.command:
                yield Html(f"another command, {element('b', change.command)}")
            same = ", after the same commands" if change.command == "" else ""
        yield from (f"{part.told}{same}" for part in parts)
        if change is not None:
            yield change.words

    def settle(self, blocks: ReplayBlocks) -> None:
        """Add the ghosts found so far to the page, as far as they fit."""
        self._waiting.settle(blocks)

    def _find_base(self, identity: str, outcome: Outcome, replay: Replay) -> str:
        base = self._base
        old = None if base is None else base.before.get(id(outcome))
        if base is None or old is None:
            return ""
        folder = base.run.folders.get(id(old))
        theirs, missing = (None, "") if folder is None else stored_replay(old, folder, self._readers["base"])
        is_same = old.digest is not None and old.digest == outcome.digest and old.engine == outcome.engine
        if theirs is None:
            if is_same:
                return ""
            return f"The motion of the {BASE_RUN} is not drawn: {missing[0].lower()}{missing[1:]}" if missing else ""
        from sim_action.reports.html.world_changes import world_changes

        world, command = world_changes(replay.scene, theirs.scene), None
        if not is_same:
            block = f"ghost-{identity}"
            found = ghost(BASE_RUN, block, replay, theirs, is_shown=old.status != outcome.status)
            self._keep(identity, found)
            self._waiting.add(block, theirs, replay)
            if (part := found.parting) is not None and not part.is_end:
                command = commands_until(replay, theirs, part.time)
        if id(outcome) in self.changes:
            self.changes[id(outcome)] = replace(self.changes[id(outcome)], world=world, command=command)
        return ""

    def _find_golden(self, identity: str, replay: Replay) -> None:
        for number, golden in enumerate(replay.golden, start=1):
            from sim_action.reports.html.golden_ghost import golden_replay

            block, theirs = f"golden-{identity}-{number}", golden_replay(replay, golden)
            label = GOLDEN if number == 1 else f"{GOLDEN} {number}"
            tolerance = Tolerance(max(POSITION_M, golden.position or 0.0), max(ANGLE_RAD, golden.yaw or 0.0))
            self._keep(identity, ghost(label, block, replay, theirs, tolerance))
            self._waiting.add(block, theirs, replay)

    def _find_engine(self, identity: str, outcome: Outcome, replay: Replay) -> None:
        other = self._others.get(id(outcome))
        if other is None or id(other) not in self._ids:
            return
        theirs, _ = stored_replay(other, self._folder, self._readers["engine"])
        if theirs is not None:
            limits = [Tolerance.of(each) for each in (outcome, other)]
            tolerance = Tolerance(max(each.position for each in limits), max(each.angle for each in limits))
            block = replay_id(self._ids[id(other)])
            self._keep(identity, ghost(other.engine or "", block, replay, theirs, tolerance))

    def _find_repetition(self, identity: str, outcome: Outcome, replay: Replay) -> None:
        if outcome.repeats is None or outcome.repeats.replay is None:
            return
        other = outcome.model_copy(update={"replay": outcome.repeats.replay})
        theirs, _ = stored_replay(other, self._folder, self._readers["repetition"])
        if theirs is not None:
            block = f"repetition-{identity}"
            self._keep(identity, ghost(REPETITION, block, replay, theirs, is_shown=True))
            self._waiting.add(block, theirs, replay)

    def _keep(self, identity: str, found: Ghost) -> None:
        self.found.setdefault(identity, []).append(found)
