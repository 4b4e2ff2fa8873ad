"""The start of the nodes that a scenario lists: their domain, environment and command lines, and errors of ended ones.

Each run has an own ROS_DOMAIN_ID, so that parallel scenarios do not hear each other.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final, Self

import yaml
from typing_extensions import override

from sim_action.core.errors import SourceProblem
from sim_action.core.records import dataclass
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_document import plain_data
from sim_action.ros import node_start
from sim_action.ros.program_failures import node_error
from sim_action.ros.ros2.installation import RMW, Ros2
from sim_action.ros.ros2.lockstep import CLOCK, clock_of
from sim_action.ros.ros2.node_processes import Node, NodeGroup, NodeProcess, ProcessFolder
from sim_action.ros.ros2.packages import Packages, command_of, workspace_of

if TYPE_CHECKING:
    from pydantic import JsonValue

    from sim_action.ros.ros2.spec import Ros2Nodes, Ros2NodeSpec

DOMAINS: Final = range(1, 102)
"""The domains whose ports are below the ephemeral ports of Linux. 0 is the default of all ROS systems."""

_LOCK: Final = "sim-action-ros2-domain"
# Of DDS: the ports of a domain begin here, and each domain has so many.
_FIRST_PORT: Final = 7400
_PORTS: Final = 250
_SOCKETS: Final = ("/proc/net/udp", "/proc/net/udp6")
_PROFILE: Final = Path(__file__).with_name("fast_dds.xml")


@dataclass(frozen=True, slots=True)
class Domain:
    """A domain, by its ROS_DOMAIN_ID, that this process holds until its lock is closed, or until this process ends."""

    number: int
    lock: socket.socket

    @classmethod
    def free(cls, name: str = _LOCK) -> Self:
        """Return a domain without participants, locked for this machine by `name` and number. Raise SourceProblem."""
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


def scratch_of(domain: Domain, workspace: Workspace, inherited: Mapping[str, str]) -> ProcessFolder:
    """Return the folder in which all processes of a run are started, with the common part of their environments."""
    variables = {
        "ROS_DOMAIN_ID": str(domain.number),
        # The profile says all about transports and discovery: LOCALHOST would add shared memory.
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
        "ROS_STATIC_PEERS": "",
        "RMW_IMPLEMENTATION": RMW,
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(_PROFILE),
        "FASTDDS_DEFAULT_PROFILES_FILE": str(_PROFILE),
        # What nodes print is in their files at once.
        "PYTHONUNBUFFERED": "1",
        # A crash has a place in the user's code.
        "PYTHONFAULTHANDLER": "1",
        "RCUTILS_COLORIZED_OUTPUT": "0",
    }
    folder = ProcessFolder(workspace.directory, {**inherited, **variables})
    folder.environment["ROS_LOG_DIR"] = str(folder.path / "log")
    return folder


def set_up_packages(spec: Ros2Nodes, ros: Ros2, workspace: Workspace, folder: ProcessFolder) -> Packages:
    """Return the packages of a scenario, and add their variables to the environment. Raise SourceProblem."""
    try:
        packages = Packages.around(workspace_of(spec.workspace, workspace), ros)
    except PathError as error:
        raise SourceProblem(str(error), "ros2") from None
    common = dict(folder.environment)
    folder.environment |= packages.set_up(folder.path)
    folder.environment |= {name: common[name] for name in ("RMW_IMPLEMENTATION", "ROS_DOMAIN_ID")}
    start = folder.path / "start"
    start.mkdir()
    (start / "sitecustomize.py").symlink_to(node_start.__file__)
    paths = (str(start), folder.environment.get("PYTHONPATH", ""))
    folder.environment["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
    return packages


class ListedNodes(NodeGroup):
    """The nodes that a scenario lists."""

    def __init__(self, spec: Ros2Nodes, packages: Packages, workspace: Workspace, folder: ProcessFolder) -> None:
        """Start the nodes, and return at once. Raise SourceProblem, ScriptError."""
        self._directory, nodes = workspace.root, spec.nodes or ()
        prefix = f"{spec.space[1:]}/_" if spec.space else ""
        numbered = [(f"{prefix}{index}", node) for index, node in enumerate(nodes)]
        started = [(at, _start_node(node, at, packages, workspace, folder)) for at, node in numbered]
        self._new = [Node(number, process) for number, process in started]
        self._started = [process for _, process in started]
        self._required = [node.required for node in nodes]
        super().__init__([process.pid for process in self._started])

    @override
    def new_nodes(self) -> list[Node]:
        self.refuse_ended()
        new, self._new = self._new, []
        return new

    @override
    def refuse_ended(self) -> None:
        for process, is_required in zip(self._started, self._required, strict=True):
            code = process.exit_code()
            if code or (code == 0 and is_required):
                raise node_error(f"the node '{process.label}'", code, process.text(), self._directory)


def _start_node(
    node: Ros2NodeSpec, number: str, packages: Packages, workspace: Workspace, folder: ProcessFolder
) -> NodeProcess:
    """Start a node with a clock of its own, whose number has its namespace. Raise SourceProblem, ScriptError."""
    assert packages.ros is not None
    try:
        if node.file is not None:
            command = command_of(workspace.file(node.file), packages.ros.python)
        else:
            command = packages.command(node.package or "", node.executable or "", folder.path)
    except PathError as error:
        raise SourceProblem(str(error), "ros2") from None
    words = [*command, *node.arguments, "--ros-args"]
    own, space = node.namespace or "", number.rpartition("/")[0]
    within = (own if own.startswith("/") else f"{space}/{own}").strip("/")
    named = {"__node": node.name, "__ns": within and f"/{within}"}
    for name, other in {**named, **node.remap, CLOCK: clock_of(number)}.items():
        words += ["-r", f"{name}:={other}"] if other else []
    if node.parameters:
        path = folder.path / f"parameters-{number.replace('/', '-')}.yaml"
        path.write_text(parameter_file(node.parameters), encoding="utf-8")
        words += ["--params-file", str(path)]
    return folder.start(f"{space}/{node.called}".lstrip("/"), [*words, "-p", "use_sim_time:=true"], stdin=node.stdin)


class _QuotingDumper(yaml.SafeDumper):
    """Writes texts in quotes: ROS 2 takes more plain words than YAML for numbers, such as 1e3 and nan."""


_QuotingDumper.add_representer(
    str, lambda dumper, text: dumper.represent_scalar("tag:yaml.org,2002:str", text, style='"')
)


def parameter_file(values: Mapping[str, JsonValue]) -> str:
    """Return a file of parameters for a node, as `--params-file` takes it."""
    return yaml.dump({"/**": {"ros__parameters": plain_data(values)}}, Dumper=_QuotingDumper)
