"""The software that outcomes depend on: a worker with other software is refused."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import cache
from typing import Final

from sim_action.core.provenance import installed_version
from sim_action.core.records import dataclass
from sim_action.core.version import PACKAGE_FOLDER, __version__
from sim_action.engines import ENGINES
from sim_action.runner.run_keys import source_digest

_DIGITS: Final = 12


@dataclass(frozen=True, slots=True)
class Software:
    """The versions that must be equal on the caller's machine and on all workers.

    Attributes:
        source: a digest of sim-action's own files.
        engines: each engine that is needed, and the version of its package; None: it is not installed.
    """

    sim_action: str
    source: str
    python: str
    engines: tuple[tuple[str, str | None], ...]

    def differences(self, here: Software) -> Iterator[str]:
        """Yield what a worker with this software has in another version than `here`, the caller's machine."""
        ours = dict(here.engines)
        pairs = [("Python", self.python, here.python), ("sim-action", self.sim_action, here.sim_action)]
        pairs += [(engine, version or "missing", ours[engine] or "missing") for engine, version in self.engines]
        for name, there, wanted in pairs:
            if there != wanted:
                yield f"{name} is {there}, here {wanted}"
        if self.sim_action == here.sim_action and self.source != here.source:
            yield f"the files of sim-action have the digest {self.source}, here {here.source}"


@cache
def software(engines: tuple[str, ...]) -> Software:
    """Return the software of this process, with these engines."""
    return Software(
        __version__,
        source_digest(PACKAGE_FOLDER)[:_DIGITS],
        ".".join(map(str, sys.version_info[:2])),
        tuple((engine, installed_version(ENGINES[engine].distribution)) for engine in engines),
    )
