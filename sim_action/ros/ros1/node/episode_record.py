"""The record of all episodes of a node: digest, distance, notes, trace and replay."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sim_action.core.geometry import Vector3
from sim_action.core.wording import escaped_line
from sim_action.recording.replay.build import replay_of
from sim_action.recording.replay.replay_data import write_replay
from sim_action.ros.ros1.launch_request import REPLAY_FILE, TRACE_FILE
from sim_action.simulation.loop import SimulationRun
from sim_action.state.trace_storage import save_trace

if TYPE_CHECKING:
    from sim_action.ros.ros1.node.episode import Episode

# A test of sensors needs no command, so a robot without any is not a finding.
_SILENT: Final = "silent-controller"
_ZEROS: Final = (
    "the nodes sent the robot no command other than zero in the whole run; check that they work, or run for longer"
)
_CLAIMS: Final = frozenset({"never-moved", _SILENT})


class EpisodeRecord:
    """Grows with each episode, and is complete also when the last one fails."""

    def __init__(self) -> None:
        self.first_command: float | None = None
        self.engine: str | None = None
        self._notes: list[str] = []
        self._digests: list[str] = []
        self._claims: dict[str, str] | None = None
        self._first: Vector3 | None = None
        self._last: Episode | None = None

    @property
    def notes(self) -> tuple[str, ...]:
        """The notes of all runs, each once."""
        return tuple(dict.fromkeys(self._notes))

    @property
    def claims(self) -> dict[str, str]:
        """The findings of the audit of claims that all runs have: rule -> message."""
        claims = self._claims or {}
        if self.first_command is None:
            return {}
        return {rule: _ZEROS if rule == _SILENT else message for rule, message in claims.items()}

    @property
    def digest(self) -> str | None:
        """The digest of all runs; with one run, its digest."""
        if len(self._digests) < 2:
            return self._digests[0] if self._digests else None
        return hashlib.sha256("".join(self._digests).encode()).hexdigest()

    @property
    def travelled(self) -> float | None:
        """The distance on the ground between the first and the last place of the robot, in m."""
        trace = self._last.footage.trace() if self._last is not None else None
        if trace is None or self._first is None:
            return None
        return float(trace.planar_distance_to(*self._first[:2])[-1])

    def begin(self, episode: Episode) -> None:
        """Note that an episode is about to run."""
        self._last = episode

    def end(self, episode: Episode, run: SimulationRun | None) -> None:
        """Add an episode; `run`: None if it failed."""
        if self.first_command is None:
            self.first_command = episode.bridge.first_command
        if self._first is None and episode.footage.start is not None:
            self._first = episode.footage.start.pose.position_xyz
        if run is not None:
            self.engine = run.engine
            self._notes += (*run.model_notes, *run.notes)
            # An episode that ended at once, by a change of the world, has no motion.
            if run.sim_time > 0:
                self._digests.append(run.digest)
                claims = {finding.rule: finding.message for finding in run.findings if finding.rule in _CLAIMS}
                earlier = claims if self._claims is None else self._claims
                self._claims = {rule: message for rule, message in claims.items() if rule in earlier}

    def store(self, folder: Path) -> None:
        """Write trace and replay of the last episode."""
        if self._last is None:
            return
        trace = self._last.footage.trace()
        film = self._last.footage.film()
        if trace is not None:
            save_trace(trace, folder / TRACE_FILE)
        if film is None:
            return
        try:
            footage = self._last.footage
            commanded, readings = footage.commanded(), footage.readings
            replay = replay_of(self._last.scene, film, commanded=commanded, readings=readings)
            write_replay(replay, folder / REPLAY_FILE)
        except Exception as error:  # noqa: BLE001 - a verdict does not depend on the replay
            self._notes.append(f"no replay was written: {escaped_line(str(error))}")
