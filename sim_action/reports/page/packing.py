"""Replays as a page carries them: one block each, unpacked when it is opened, and one of the meshes they share."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from sim_action.recording.replay import Replay
from sim_action.recording.replay.shapes import MeshData

MOST_BYTES: Final = 8_000_000
"""Of all blocks, that of the meshes among them: what comes after these has none, and failures come first."""

_LEVEL: Final = 9


def packed(data: bytes) -> str:
    """Gzip and base64; the same for the same data, always."""
    return base64.b64encode(gzip.compress(data, _LEVEL, mtime=0)).decode("ascii")


def told(data: object) -> str:
    """JSON that can stand in a page: nothing in it ends the element around it."""
    return json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")


@dataclass(slots=True)
class Parcel:
    """The blocks of a page, as they come in; `size`: of all, as meshes would pack that came alone."""

    blocks: dict[str, str] = field(default_factory=dict)
    meshes: dict[str, MeshData] = field(default_factory=dict)
    size: int = 0

    def takes(self, identity: str, replay: Replay) -> bool:
        """Whether there was room for a replay."""
        block = packed(replay.model_dump_json(exclude={"scene": {"meshes"}}, exclude_none=True).encode())
        new = {digest: mesh for digest, mesh in replay.scene.meshes.items() if digest not in self.meshes}
        size = self.size + len(block) + (len(_packed_meshes(new)) if new else 0)
        if size > MOST_BYTES:
            return False
        self.size = size
        self.blocks[identity] = block
        self.meshes |= new
        return True

    @property
    def shared(self) -> str:
        """The block of all meshes, by their digests."""
        return _packed_meshes(self.meshes)


def _packed_meshes(meshes: Mapping[str, MeshData]) -> str:
    return packed(told({digest: mesh.model_dump() for digest, mesh in meshes.items()}).encode())
