"""Replays as a page carries them: one block each, unpacked when it is opened, and one of the meshes they share."""

from __future__ import annotations

import base64
import gzip
import json
from dataclasses import dataclass, field
from typing import Final

from sim_action.replay import Replay
from sim_action.replay.shapes import MeshData

MOST_BYTES: Final = 8_000_000
"""Of all blocks: what comes after these has none, and failures come first."""

_LEVEL: Final = 9


def packed(data: bytes) -> str:
    """Gzip and base64; the same for the same data, always."""
    return base64.b64encode(gzip.compress(data, _LEVEL, mtime=0)).decode("ascii")


def told(data: object) -> str:
    """JSON that can stand in a page: nothing in it ends the element around it."""
    return json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")


@dataclass(slots=True)
class Parcel:
    """The blocks of a page, as they come in."""

    blocks: dict[str, str] = field(default_factory=dict)
    meshes: dict[str, MeshData] = field(default_factory=dict)
    size: int = 0

    def takes(self, identity: str, replay: Replay) -> bool:
        """Whether there was room for a replay."""
        block = packed(replay.model_dump_json(exclude={"scene": {"meshes"}}, exclude_none=True).encode())
        if self.size + len(block) > MOST_BYTES:
            return False
        self.size += len(block)
        self.blocks[identity] = block
        self.meshes |= replay.scene.meshes
        return True

    @property
    def shared(self) -> str:
        """The block of all meshes, by their digests."""
        meshes = {digest: mesh.model_dump() for digest, mesh in self.meshes.items()}
        return packed(told(meshes).encode())
