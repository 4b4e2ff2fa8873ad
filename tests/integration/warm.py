"""The command line without the start of an interpreter: each call is a fork of a process that has imported everything.

For tests of what commands do. A test of a process itself (its start, its signals, its encoding, what it imports) calls
`tests.integration.conftest.fresh_sim_action` or starts an interpreter by itself.
"""

from __future__ import annotations

import atexit
import ctypes
import gc
import importlib
import json
import os
import pkgutil
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, NoReturn

import pytest
from pydantic import BaseModel

import sim_action
from sim_action.cli.main import leave, main
from sim_action.engines import ENGINES, installed
from sim_action.runner.child_outcome import engine_provenance
from sim_action.runner.process_pool import warm_up
from sim_action.scenario.loading import load_scenario

ROOT: Final = Path(__file__).parents[2]


class WarmCommandLine:
    """A process that forks once for each call. It starts with the first one and ends with this process."""

    def __init__(self) -> None:
        self._server: subprocess.Popen[str] | None = None

    def call(
        self, folder: Path, arguments: tuple[str, ...], environment: dict[str, str], program: str = "sim-action"
    ) -> tuple[int, str, str]:
        """Run `sim-action`, or `pytest`, in a folder; return its exit code and what it printed on both streams."""
        with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as error:
            asked = {
                "program": program,
                "arguments": arguments,
                "folder": str(folder),
                "environment": environment,
                "streams": [f"/proc/{os.getpid()}/fd/{stream.fileno()}" for stream in (out, error)],
            }
            code = self._answer(asked)
            printed = []
            for stream in (out, error):
                stream.seek(0)
                printed.append(stream.read().decode())
        return code, printed[0], printed[1]

    def close(self) -> None:
        """End the process."""
        if self._server:
            self._server.communicate()

    def _answer(self, asked: dict[str, Any]) -> int:
        server = self._server = self._server or _started()
        assert server.stdin
        assert server.stdout
        server.stdin.write(json.dumps(asked) + "\n")
        server.stdin.flush()
        return int(server.stdout.readline())


def _started() -> subprocess.Popen[str]:
    # As the command line does before it imports anything: a process that forks must have started no thread.
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    environment["PYDANTIC_DISABLE_PLUGINS"] = "__all__"
    command = [sys.executable, "-m", "tests.integration.warm"]
    return subprocess.Popen(
        command, cwd=ROOT, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )


WARM: Final = WarmCommandLine()
atexit.register(WARM.close)


def _serve() -> None:
    """Answer each line of standard input with the exit code of a call."""
    answers, errors = os.fdopen(os.dup(1), "w"), os.dup(2)
    # An engine prints a line when it is imported.
    nothing = os.open(os.devnull, os.O_WRONLY)
    for number in (1, 2):
        os.dup2(nothing, number)
    _import_everything()
    ctypes.CDLL(None).fflush(None)
    os.dup2(errors, 2)
    gc.freeze()
    for line in sys.stdin:
        asked = json.loads(line)
        child = os.fork()
        if not child:
            _become(asked)
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), file=answers, flush=True)


_LATER: Final = ("sim_action.ros.", "sim_action.runner.cluster.")  # what few calls need, and takes long to import


def _import_everything() -> None:
    for module in pkgutil.walk_packages(sim_action.__path__, "sim_action."):
        if not module.name.startswith(_LATER) and not module.name.endswith("__main__"):
            # Without an optional package, or on another system, some modules cannot be imported.
            with suppress(ImportError, AssertionError):
                importlib.import_module(module.name)
    # Their validators are made at the first use.
    models = BaseModel.__subclasses__()
    for model in models:
        models += model.__subclasses__()
        model.model_rebuild()
    loaded = load_scenario(ROOT / "examples/turtlebot3/straight_line.sim.yml")
    warm_up([loaded], (), replays=True)
    for engine in installed():
        ENGINES[engine].load().warm_up()
        engine_provenance(engine)


def _become(asked: dict[str, Any]) -> NoReturn:
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    for number, path in enumerate(asked["streams"], 1):
        os.dup2(os.open(path, os.O_WRONLY | os.O_APPEND), number)
    os.chdir(asked["folder"])
    os.environ.clear()
    os.environ.update(asked["environment"])
    sys.path[0] = asked["folder"]
    sys.argv = [str(ROOT / "sim_action/__main__.py"), *asked["arguments"]]
    sys.stdin, sys.stdout, sys.stderr = (os.fdopen(number, "rww"[number], closefd=False) for number in range(3))
    # An interpreter reads it when it starts.
    sys.path[1:1] = [path for path in os.environ["PYTHONPATH"].split(os.pathsep) if path not in sys.path]
    if asked["program"] == "pytest":
        leave(pytest.main(asked["arguments"]))
    main()


if __name__ == "__main__":
    _serve()
