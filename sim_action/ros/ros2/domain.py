"""The domain of a run: an own ROS_DOMAIN_ID, so that parallel scenarios do not hear each other."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final, Self

from sim_action.core.errors import SourceProblem
from sim_action.core.records import dataclass

DOMAINS: Final = range(1, 102)
"""The domains whose ports are below those that Linux gives to any program. 0 is the default of all ROS systems."""

_LOCK: Final = "sim-action-ros2-domain"
# Of DDS: the ports of a domain begin here, and each domain has so many.
_FIRST_PORT: Final = 7400
_PORTS: Final = 250
_SOCKETS: Final = ("/proc/net/udp", "/proc/net/udp6")


@dataclass(frozen=True, slots=True)
class Domain:
    """A domain that this process holds until it is closed, or until this process ends.

    Attributes:
        number: the ROS_DOMAIN_ID.
        lock: a socket whose name nothing else on this machine can have.
    """

    number: int
    lock: socket.socket

    @classmethod
    def free(cls, name: str = _LOCK) -> Self:
        """Return a domain without participants, locked for all processes of this machine. Raise SourceProblem.

        :param name: the beginning of the names of the locks.
        """
        used = frozenset(_used())
        # Processes that start at the same time begin their search at different places.
        start = os.getpid() % len(DOMAINS)
        for number in (*DOMAINS[start:], *DOMAINS[:start]):
            if number in used:
                continue
            # A name in no folder: each process has a folder of its own for temporary files.
            lock = socket.socket(socket.AF_UNIX)
            try:
                lock.bind(f"\0{name}-{number}")
            except OSError:
                lock.close()
                continue
            return cls(number, lock)
        raise SourceProblem(
            f"all {len(DOMAINS)} domains of ROS 2 are in use on this machine; end other ROS 2 systems, or run fewer "
            "scenarios at the same time (--jobs)",
            "ros2",
        )

    def close(self) -> None:
        """Release the domain."""
        self.lock.close()


def _used() -> Iterator[int]:
    """Yield the domains whose ports are in use on this machine."""
    for path in _SOCKETS:
        with suppress(OSError):
            for line in Path(path).read_text(encoding="ascii").splitlines()[1:]:
                port = int(line.split()[1].rpartition(":")[2], 16)
                if port >= _FIRST_PORT:
                    yield (port - _FIRST_PORT) // _PORTS
