"""The errors that nodes log, as the bridge hears them on /rosout."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from sim_action.core.errors import Location
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line, shortened
from sim_action.ros.program_failures import shown_path
from sim_action.ros.ros2.bridge_link import Endpoint
from sim_action.ros.ros2.messages import Message
from sim_action.ros.ros2.quality import Qos, TopicEnd

ROSOUT: Final = "/rosout"
_TYPE: Final = "rcl_interfaces/msg/Log"
# As publishers of logs have it: late subscribers get what was logged before.
_DEPTH: Final = 1000
_ERROR: Final = 40
_FATAL: Final = 50
_MAX_CHARS: Final = 300
_MAX_ERRORS: Final = 10


def errors_endpoint(publishers: Sequence[TopicEnd]) -> Endpoint:
    """Return the subscription to errors, with the durability that its publishers have."""
    keeps = all(end.durability == "transient_local" for end in publishers)
    qos = Qos(durability="transient_local" if keeps else "volatile", depth=_DEPTH)
    return Endpoint(ROSOUT, _TYPE, qos, least=("level", _ERROR))


@dataclass(frozen=True, slots=True)
class _Source:
    """A line of a node's code that logs errors."""

    node: str
    level: int
    file: str
    line: int


class LoggedErrors:
    """The errors of a run, those of one line of code together.

    Attributes:
        messages: one for each such line, in the order of their first errors.
    """

    def __init__(self, directory: Path) -> None:
        """Begin without errors; `directory`: that of the user's code."""
        self._directory = directory
        self._first: dict[_Source, tuple[int, str]] = {}
        self._times: Counter[_Source] = Counter()
        self.messages: list[str] = []

    def take(self, message: Message, seconds: float | None) -> None:
        """Take a message of the topic, at a sim time in s; None: sim time has not begun."""
        source = _Source(message["name"], message["level"], message["file"], message["line"])
        when = "before sim time began" if seconds is None else f"at {seconds:g} s of sim time"
        said = shortened(escaped_line(message["msg"].strip()), _MAX_CHARS)
        place, _ = self._first.setdefault(source, (len(self._first), f"{when}: {said}"))
        self._times[source] += 1
        if place > _MAX_ERRORS:
            return
        text = self._text(source) if place < _MAX_ERRORS else "nodes logged errors in more places"
        self.messages[place : place + 1] = [text]

    def _text(self, source: _Source) -> str:
        times = self._times[source]
        kind = "a fatal error" if source.level >= _FATAL else "an error"
        often = f" {times} times, first" if times > 1 else ""
        where = f" ({place})" if (place := self._location(source)) else ""
        return escaped_line(f"the node '{source.node}' logged {kind}{often} {self._first[source][1]}{where}")

    def _location(self, source: _Source) -> Location | None:
        path = Path(source.file)
        if not source.file or not path.is_absolute() or not path.resolve().is_relative_to(self._directory.resolve()):
            return None
        return Location(shown_path(path.resolve()), source.line)
