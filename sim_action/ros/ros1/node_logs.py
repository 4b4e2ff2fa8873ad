"""What nodes have written into their logs of callbacks that raised: rospy tells it there, and goes on.

A log is `ROS_LOG_DIR/RUN/NODE-NUMBER.log`, one folder for each launch.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sim_action.core.errors import Location
from sim_action.core.files import read_at_most
from sim_action.core.messages import escaped_line
from sim_action.ros.ros1.traceback_text import location_in

_MOST_BYTES: Final = 16_000_000
_OUTPUT: Final = "-stdout"
_NUMBER: Final = re.compile(r"-\d+$")
# From rospy/topics.py: what it was told of, how it came to be raised, and, where a line begins with no blank, what.
_RAISED: Final = re.compile(
    r"^(?:\[rosout\])?\[ERROR\][^\n]*?: bad callback: ([^\n]*)\n(Traceback[^\n]*\n(?:[ ][^\n]*\n)*)(\S[^\n]*)",
    re.MULTILINE,
)
_SIMULATION: Final = "gazebo"


@dataclass(frozen=True, slots=True)
class BadCallback:
    """One that raised, the same each time.

    Attributes:
        exception: as Python prints it.
        location: in the user's code.
    """

    node: str
    exception: str
    location: Location | None
    times: int

    def __str__(self) -> str:
        often = f" {self.times} times" if self.times > 1 else ""
        place = f" at {self.location}" if self.location else ""
        return escaped_line(f"a callback of the node '{self.node}' raised{often}: {self.exception}{place}")


def bad_callbacks(logs: Path, process: str | None, workspace: Path) -> tuple[BadCallback, ...]:
    """Those of the launch whose simulation was a process, the most frequent of each node first."""
    counts = Counter(
        (_NUMBER.sub("", log.stem), exception.strip(), location_in(trace, workspace))
        for log in _logs(logs, process)
        for _, trace, exception in _RAISED.findall(_text(log))
    )
    return tuple(BadCallback(*key, times) for key, times in counts.most_common())


def _logs(logs: Path, process: str | None) -> Iterator[Path]:
    for folder in sorted(path for path in logs.iterdir() if path.is_dir() and not path.is_symlink()):
        if process is None or any(f"pid[{process}]" in _text(log) for log in folder.glob(f"{_SIMULATION}-*.log")):
            yield from (log for log in sorted(folder.glob("*.log")) if not log.stem.endswith(_OUTPUT))


def _text(log: Path) -> str:
    return (read_at_most(log, _MOST_BYTES) or b"").decode("utf-8", errors="replace")
