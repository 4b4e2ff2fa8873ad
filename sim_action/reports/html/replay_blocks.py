"""The packed replays of a page: which ones fit, and the meshes that they share."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Final, Self

from sim_action.core.records import dataclass, field
from sim_action.recording.replay.replay_data import Replay, ReplayError, ReplayReader
from sim_action.recording.replay.scene_data import MAX_TEXT_LENGTH, MeshData
from sim_action.reports.escaping import one_line
from sim_action.results.artifacts import stored_file
from sim_action.results.outcome import Outcome


def replay_id(identity: str) -> str:
    """Return the element id of the replay of an article."""
    return f"replay-{identity}"


def stored_replay(outcome: Outcome, folder: Path, reader: ReplayReader) -> tuple[Replay | None, str]:
    """Return the replay of a run, or None and the reason why there is none."""
    if outcome.replay is None:
        return None, "" if outcome.digest is None else "No replay of this run was stored."
    path = stored_file(folder, outcome.replay)
    if path is None:
        return None, "The replay file of this run is missing."
    try:
        replay = reader.read(path)
    except ReplayError as error:
        return None, f"The replay cannot be read: {one_line(str(error))}"
    if replay.scenario is not None and replay.scenario != outcome.name[:MAX_TEXT_LENGTH]:
        return None, f"The replay is left out: it is of another scenario, '{one_line(replay.scenario)}'."
    return replay, ""


MAX_REPLAY_BYTES: Final = 8_000_000
"""The size of all replays and meshes in a page; scenarios beyond it, the best ones, get no replay."""

_LEVEL: Final = 5  # level 9 takes twice as long, for 1 % less


def packed(data: bytes) -> str:
    """Return data as gzip in base64, identical for identical data."""
    return base64.b64encode(gzip.compress(data, _LEVEL, mtime=0)).decode("ascii")


def page_json(data: object) -> str:
    """Return JSON that is safe inside a script element: it contains no `<`."""
    return json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")


@dataclass(frozen=True, slots=True)
class PackedReplay:
    """A replay as it is in a page: packed without its meshes, which other replays may share."""

    block: str
    meshes: Mapping[str, MeshData]

    @classmethod
    def of(cls, replay: Replay) -> Self:
        """Pack a replay."""
        data = replay.model_dump_json(exclude={"scene": {"meshes"}}, exclude_none=True).encode()
        return cls(packed(data), replay.scene.meshes)


@dataclass(slots=True)
class ReplayBlocks:
    """The packed replays of a page and the meshes that they share; `size` is an upper bound in bytes."""

    blocks: dict[str, str] = field(default_factory=dict)
    meshes: dict[str, MeshData] = field(default_factory=dict)
    size: int = 0

    def add(self, identity: str, replay: Replay) -> bool:
        """Add a replay if it fits; return False if it does not."""
        return self.put(identity, PackedReplay.of(replay))

    def put(self, identity: str, replay: PackedReplay) -> bool:
        """Add a packed replay if it fits; return False if it does not."""
        new = {digest: mesh for digest, mesh in replay.meshes.items() if digest not in self.meshes}
        size = self.size + len(replay.block) + (len(_packed_meshes(new)) if new else 0)
        if size > MAX_REPLAY_BYTES:
            return False
        self.size = size
        self.blocks[identity] = replay.block
        self.meshes |= new
        return True

    @property
    def shared(self) -> str:
        """The packed meshes by digest."""
        return _packed_meshes(self.meshes)


def _packed_meshes(meshes: Mapping[str, MeshData]) -> str:
    return packed(page_json({digest: mesh.model_dump() for digest, mesh in meshes.items()}).encode())
