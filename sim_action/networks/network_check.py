"""The check of an ONNX network before a run: a process of its own opens it and feeds it with zeros.

What a run returns counts, and not the shapes that the file declares. The process runs no code of the user. Its memory
and processor time are limited on Linux; elsewhere its time alone is.
"""

from __future__ import annotations

import json
import math
import mmap
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from sim_action.core.process import BEFORE_IMPORTS
from sim_action.core.workspace import PathError, Workspace
from sim_action.networks.onnx_network import TOO_MUCH_MEMORY, Feed, Network, NetworkProblem, Session, Tensor

CHECK: Final = (sys.executable, "-P", "-m", "sim_action.networks.network_check")  # the command of the process
_PACKAGE_ROOT: Final = Path(__file__).resolve().parents[2]
_OPEN_BYTES: Final = 32_000_000
_BYTES_PER_NETWORK_BYTE: Final = 2  # memory to open a network
_RUN_BYTES: Final = 96_000_000
_BYTES_PER_INPUT_VALUE: Final = 256  # memory to run it, in addition
_OPEN_CPU_S: Final = 1.0
_OPENED_BYTES_PER_S: Final = 50_000_000
_RUN_CPU_S: Final = 10.0
_MAX_WALL_S: Final = 120.0


def checked_network(workspace: Workspace, file: str, feeds: Mapping[str, Feed]) -> Network:
    """Return a network after a run with zeros. Raise NetworkProblem, PathError, OSError.

    It is opened again only if its file or folder has changed. Without feeds, it is run only if it declares all shapes.
    """
    path = workspace.file(file)
    status = path.stat()
    stamps = (status.st_mtime_ns, status.st_size, path.parent.stat().st_mtime_ns)
    place = [str(workspace.directory), str(workspace.root), workspace.allow_outside, workspace.packages]
    feed_fields = {name: [feed.size, feed.frames, feed.shape, feed.value] for name, feed in feeds.items()}
    answer = json.loads(_answer(json.dumps([place, file, feed_fields]), stamps))
    if "problem" in answer:
        raise NetworkProblem(answer["problem"])
    inputs, outputs = (
        {name: Tensor(name, kind, tuple(shape)) for name, kind, shape in answer[key]} for key in ("inputs", "outputs")
    )
    return Network(inputs, outputs, answer["metadata"], answer["results"])


@lru_cache(maxsize=64)
def _answer(question: str, stamps: tuple[int, ...]) -> str:
    """Return the answer of the process, as JSON; `stamps`: of the version of the network."""
    path = os.pathsep.join(filter(None, (str(_PACKAGE_ROOT), os.environ.get("PYTHONPATH"))))
    try:
        ended = subprocess.run(  # noqa: S603 - this interpreter, and no code of a scenario
            CHECK,
            input=question.encode(),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **BEFORE_IMPORTS, "PYTHONPATH": path},
            timeout=_MAX_WALL_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return json.dumps({"problem": f"takes onnxruntime more than {_MAX_WALL_S:g} s"})
    if ended.returncode == 0:
        return ended.stdout.decode()
    if sys.platform != "win32" and ended.returncode == -signal.SIGPROF:
        limits = f"{_open_seconds(stamps[1]):.1f} s to be opened, or {_RUN_CPU_S:g} s to run once"
        return json.dumps({"problem": f"takes onnxruntime more processor time than {limits}"})
    return json.dumps({"problem": f"made onnxruntime crash (status {ended.returncode})"})


def _open_seconds(size: int) -> float:
    return _OPEN_CPU_S + size / _OPENED_BYTES_PER_S


def _used_bytes() -> int:
    """Return the address space of this process."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * mmap.PAGESIZE


def _allow(base: int, more: int, seconds: float) -> None:
    """Limit the address space of this process, in bytes, and its processor time from now on."""
    if sys.platform != "win32":
        signal.setitimer(signal.ITIMER_PROF, seconds)
    if sys.platform == "linux":
        import resource

        # The process of a scenario may have a limit of its own.
        _, most = resource.getrlimit(resource.RLIMIT_AS)
        limit = base + more if most == resource.RLIM_INFINITY else min(base + more, most)
        resource.setrlimit(resource.RLIMIT_AS, (limit, most))


def answer_of(place: list[Any], file: str, feed_fields: Mapping[str, list[Any]]) -> dict[str, Any]:
    """Return the answer of the process to a question."""
    directory, root, allow_outside, packages = place
    workspace = Workspace(
        Path(directory), Path(root), allow_outside, packages=tuple((name, folder) for name, folder in packages)
    )
    feeds = {
        name: Feed(size, frames, shape and tuple(shape), tuple(value) if isinstance(value, list) else value)
        for name, (size, frames, shape, value) in feed_fields.items()
    }
    base = list[int]()

    def limit(size: int) -> None:
        if not base:
            # onnxruntime is imported now.
            base.append(_used_bytes() if sys.platform == "linux" else 0)
        _allow(base[0], _OPEN_BYTES + _BYTES_PER_NETWORK_BYTE * size, _open_seconds(size))

    try:
        session = Session(workspace, file, limit)
        values = sum(math.prod(feed.shape or ()) for feed in feeds.values())
        memory = _OPEN_BYTES + _BYTES_PER_NETWORK_BYTE * session.size + _RUN_BYTES + _BYTES_PER_INPUT_VALUE * values
        _allow(base[0], memory, _RUN_CPU_S)
        network = session.network
        try:
            network = session.fit(feeds)
        except NetworkProblem:
            # Zeros may be wrong for inputs whose values are not known yet.
            if feeds:
                raise
    except (NetworkProblem, PathError, OSError) as error:
        return {"problem": str(error)}
    except MemoryError:
        return {"problem": TOO_MUCH_MEMORY}
    except ImportError as error:
        return {"problem": f"cannot be read: onnxruntime cannot be imported: {error}"}
    tensors = {"inputs": network.inputs, "outputs": network.outputs}
    return {
        **{
            key: [[tensor.name, tensor.type, tensor.shape] for tensor in group.values()]
            for key, group in tensors.items()
        },
        "metadata": dict(network.metadata),
        "results": network.results,
    }


if __name__ == "__main__":
    sys.stdout.write(json.dumps(answer_of(*json.load(sys.stdin))))
