"""The output of a launch: ends of nodes, errors of roslaunch, and callbacks that raised.

rospy logs the exceptions of callbacks and goes on. A log is `ROS_LOG_DIR/RUN/NODE-NUMBER.log`, with one folder RUN for
each launch.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path, PurePath
from typing import Final

from sim_action.core.errors import Location
from sim_action.core.files import content_or_empty
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line
from sim_action.ros.program_failures import exit_text, traceback_location

# Colours and window titles, as they are and as rosunit escapes them.
_COLOURS: Final = re.compile(r"(?:\x1b|&#x001B;)(?:\[[0-9;]*m|\][^\x07\n]*(?:\x07|&#x0007;))")
# Paths of logs in the folder of the call, which is deleted at the end.
_LOG_PATHS: Final = re.compile(
    r"^(?:log file: .*\*\.log|\.\.\. logging to .*|rostest log file is in .*)\n?", re.MULTILINE
)
_NODE: Final = r"\[([\w/.-]+?)(?:-\d+)?\]"
_END: Final = r"process has (?:died \[pid \d+, exit code (-?\d+), cmd (\S+)|finished cleanly)"
_DEAD: Final = re.compile(rf"{_NODE} {_END}")
_REQUIRED: Final = re.compile(rf"REQUIRED process {_NODE} has died!\s+{_END}")
_NO_PACKAGE: Final = re.compile(
    r"^(?:rospkg\.\w+\.)?(?:ResourceNotFound|Resource not found): *(?:The following package was not found in .*: )?"
    r"(\S+)$",
    re.MULTILINE,
)
_REFUSED: Final = (
    re.compile(r"^ERROR: (cannot launch node of type .+)$", re.MULTILINE),
    re.compile(r"^(?:roslaunch\.\w+\.)?(?:RLException|XmlParseException|LaunchParamException): *(.+)$", re.MULTILINE),
)
_NOT_LAUNCHED: Final = re.compile(
    r"^ERROR: cannot launch node of type \[([^/\]\s]+)/([^\]\s]+)\]: *(.+)$", re.MULTILINE
)
_EXCEPTION: Final = re.compile(r"^[A-Za-z_][\w.]*(?:Error|Exception|Interrupt|Exit)(?:: .*)?$", re.MULTILINE)
_XACRO: Final = re.compile(r"^xacro: (.+)$", re.MULTILINE)
_MAX_TAIL_CHARS: Final = 4_000
_MAX_LOG_BYTES: Final = 16_000_000
_STDOUT_SUFFIX: Final = "-stdout"
_NUMBER_SUFFIX: Final = re.compile(r"-\d+$")
# Written by rospy/topics.py: the callback, the traceback, and the exception in the first line without indentation.
_CALLBACK_ERROR: Final = re.compile(
    r"^(?:\[rosout\])?\[ERROR\][^\n]*?: bad callback: ([^\n]*)\n(Traceback[^\n]*\n(?:[ ][^\n]*\n)*)(\S[^\n]*)",
    re.MULTILINE,
)
_SIMULATION_NODE: Final = "gazebo"


@dataclass(frozen=True, slots=True)
class Death:
    """The end of a node; `exit_code` is negative for a signal, `program` is empty if it is unknown."""

    node: str
    exit_code: int
    program: str = ""

    def __str__(self) -> str:
        return f"the node '{self.node}' ended with {exit_text(self.exit_code)}"


def cleaned_output(text: str) -> str:
    """Return output without colours, window titles and log paths."""
    return _LOG_PATHS.sub("", _COLOURS.sub("", text).replace("\r", ""))


def required_deaths(text: str) -> Iterator[Death]:
    """Yield the ends of required nodes."""
    return (Death(name, int(code or 0), program) for name, code, program in _REQUIRED.findall(text))


def deaths(text: str) -> Iterator[Death]:
    """Yield the ends of nodes that failed."""
    return (Death(name, int(code), program) for name, code, program in _DEAD.findall(text) if code)


@dataclass(frozen=True, slots=True)
class NotLaunched:
    """A node that roslaunch could not start; `reason`: in its words."""

    package: str
    program: str
    reason: str


def nodes_not_launched(text: str) -> tuple[NotLaunched, ...]:
    """Return the nodes that roslaunch could not start. It goes on without them, also without a required one."""
    return tuple(NotLaunched(*groups) for groups in dict.fromkeys(_NOT_LAUNCHED.findall(text)))


def missing_package(text: str) -> str | None:
    """Return the package that a launch file needs and roslaunch did not find."""
    return _first(_NO_PACKAGE, text)


def refusal(text: str) -> str | None:
    """Return the reason why roslaunch refused a launch file."""
    return _first(_REFUSED[0], text) or _first(_REFUSED[1], text)


def xacro_error(text: str) -> str | None:
    """Return the error message of our xacro program."""
    return _first(_XACRO, text)


def _first(pattern: re.Pattern[str], text: str) -> str | None:
    return match[1].strip() if (match := pattern.search(text)) else None


def last_exception(text: str, program: str) -> str | None:
    """Return the last exception of a Python program: the one after the last mention of its file."""
    name = PurePath(program).name
    place = text.rfind(f'/{name}", line ') if name else -1
    match = _EXCEPTION.search(text, place) if place >= 0 else None
    return match[0] if match else None


def output_tail(text: str) -> str:
    """Return the end of the output."""
    return text.strip("\n")[-_MAX_TAIL_CHARS:]


@dataclass(frozen=True, slots=True)
class CallbackError:
    """A callback that raised, and how many times it raised the same exception; `location`: in the user's code."""

    node: str
    exception: str
    location: Location | None
    times: int

    @property
    def is_assertion(self) -> bool:
        """True if an assertion did not hold."""
        return self.exception.partition(":")[0].rpartition(".")[2] == "AssertionError"

    def is_of(self, test: str) -> bool:
        """Return True if the node belongs to a test; logs name a node with its namespace."""
        return self.node == test or self.node.endswith(f"-{test}")

    def __str__(self) -> str:
        often = f" {self.times} times" if self.times > 1 else ""
        place = f" at {self.location}" if self.location else ""
        return escaped_line(f"a callback of the node '{self.node}' raised{often}: {self.exception}{place}")


def callback_errors(logs: Path, process: str | None, workspace: Path) -> tuple[CallbackError, ...]:
    """Return failed callbacks, the most frequent first; `process`: id of the simulation of the launch; None: of all."""
    counts = Counter(
        (_NUMBER_SUFFIX.sub("", log.stem), exception.strip(), traceback_location(trace, workspace))
        for log in _logs(logs, process)
        for _, trace, exception in _CALLBACK_ERROR.findall(_text(log))
    )
    return tuple(CallbackError(*key, times) for key, times in counts.most_common())


def _logs(logs: Path, process: str | None) -> Iterator[Path]:
    for folder in sorted(path for path in logs.iterdir() if path.is_dir() and not path.is_symlink()):
        if process is None or any(f"pid[{process}]" in _text(log) for log in folder.glob(f"{_SIMULATION_NODE}-*.log")):
            yield from (log for log in sorted(folder.glob("*.log")) if not log.stem.endswith(_STDOUT_SUFFIX))


def _text(log: Path) -> str:
    return content_or_empty(log, _MAX_LOG_BYTES).decode("utf-8", errors="replace")
