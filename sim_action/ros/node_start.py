"""Code that Python runs at the start of each process of a launch, to make nodes reproducible.

The generators of `random`, numpy and `numpy.random.default_rng()` start from the seed of the run and the name of the
node. A timeout of an executor of rclpy, as in `spin_once(timeout_sec=0.1)`, is sim time where the node has
`use_sim_time`. A loop around `rate.sleep()` goes on after `rclpy.spin` in another thread has handled all that was due.

Python imports this file as `sitecustomize`. It imports nothing of this package; the patches of ROS 1 lie next to it.
"""

from __future__ import annotations

import importlib.abc
import importlib.util
import os
import sys
import threading
import zlib
from collections.abc import Callable, Sequence
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

SEED = "SIM_ACTION_NODE_SEED"  # environment variable with the seed of the run
PATCHES = "sim_action_ros_patches"  # module next to this one, in launches of ROS 1
ORDERED = "sim.ordered"  # name of a thread that ran when no executor handled messages
_ENTITIES = ("subscription", "guard_condition", "timer", "client", "service")
_MAX_TURN_S = 10.0  # as long as lock-step waits for a node
_NAMES = ("__name:=", "__node:=", "__ns:=")  # what a node is called, in the arguments of either ROS


def variables(seed: int) -> dict[str, str]:
    """Return the environment variables of processes that start with this code."""
    return {SEED: str(seed), "PYTHONHASHSEED": str(seed % 2**32)}


Patch = Callable[[dict[str, Any]], None]


def _seed(more: str = "") -> int:
    """Return the seed of this process: nodes with the same program draw different numbers."""
    words = sys.orig_argv
    names = [word for word in words if word.startswith(_NAMES)]
    programs = [os.path.basename(word) for word in words[1:2]]  # noqa: PTH119 - to import pathlib takes 10 ms
    return zlib.crc32("\0".join((os.environ.get(SEED, "0"), *programs, *names, more)).encode())


def _seed_numpy(module: dict[str, Any]) -> None:
    module["seed"](_seed())
    make, made = module["default_rng"], 0

    def default_rng(seed: Any = None) -> Any:
        nonlocal made
        made += seed is None
        return make((_seed(), made) if seed is None else seed)

    module["default_rng"] = default_rng


def _replace_timeouts(executors: dict[str, Any]) -> None:
    executor = executors["Executor"]
    add = executor.add_node

    def add_node(self: Any, node: Any) -> Any:
        if node.has_parameter("use_sim_time") and node.get_parameter("use_sim_time").value:
            self._clock = node.get_clock()
        return add(self, node)

    executor.add_node = add_node

    library = executors["_rclpy"]
    copy = ModuleType(library.__name__)
    vars(copy).update(vars(library), WaitSet=_waiting(library.WaitSet))
    executors["_rclpy"] = copy


class _Turns:
    """The turns of the loops that sleep by a clock, and of the executors of other threads, in one process."""

    def __init__(self) -> None:
        self._change = threading.Condition()
        self._handling = set[int]()
        self._sleepers = 0
        # Loops that do not sleep -> True if no executor has handled anything meanwhile.
        self._loops: dict[int, bool] = {}

    def must_look(self) -> bool:
        """Return True if a loop of another thread may wait until this one has handled all that is due."""
        return self._sleepers > 0 and threading.get_native_id() in self._handling

    def wait(self) -> None:
        """Note that this thread waits for messages and timers."""
        with self._change:
            self._handling.discard(threading.get_native_id())
            self._change.notify_all()

    def handle(self) -> None:
        """Note that this thread handles messages and timers."""
        with self._change:
            self._handling.add(threading.get_native_id())
            self._loops = dict.fromkeys(self._loops, False)

    def ordered(self, sleep: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that sleeps, and returns when no executor handles anything."""

        def sleep_in_turn(*args: Any, **kwargs: Any) -> Any:
            thread = threading.get_native_id()
            with self._change:
                self._handling.discard(thread)
                self._sleepers += 1
                name = ORDERED if self._loops.pop(thread, True) else "unordered"
            with open(f"/proc/self/task/{thread}/comm", "w") as file:  # noqa: PTH123 - as above
                file.write(name)
            try:
                result = sleep(*args, **kwargs)
                with self._change:
                    if not (is_ordered := self._change.wait_for(lambda: not self._handling, _MAX_TURN_S)):
                        self._handling.clear()  # such as a thread that has left its executor
                    self._loops = {**dict.fromkeys(self._loops, False), thread: is_ordered and not self._loops}
            finally:
                with self._change:
                    self._sleepers -= 1
            return result

        return sleep_in_turn


_TURNS = _Turns()


def _order_rates(timer: dict[str, Any]) -> None:
    timer["Rate"].sleep = _TURNS.ordered(timer["Rate"].sleep)


def _order_sleeps(clock: dict[str, Any]) -> None:
    clock["Clock"].sleep_until = _TURNS.ordered(clock["Clock"].sleep_until)


def _waiting(wait_set: type[Any]) -> type[Any]:
    """Return a set that waits without a timeout: a timer in it stands for that, and need not be of the wall clock."""

    class WaitSet(wait_set):  # type: ignore[misc]  # ROS has no types
        def wait(self, nanoseconds: int) -> None:
            if nanoseconds and _TURNS.must_look():
                super().wait(0)
                if not any(map(self.get_ready_entities, _ENTITIES)):
                    _TURNS.wait()  # the executor makes a new set, and waits with that
                return
            _TURNS.wait()
            super().wait(-1 if nanoseconds > 0 else nanoseconds)
            _TURNS.handle()

    return WaitSet


def _seed_with_time(time_source: dict[str, Any]) -> None:
    """Seed again at the first message of the clock: what a node drew before depends on how long it waited."""
    source = time_source["TimeSource"]
    hear, hears_first = source.clock_callback, True

    def clock_callback(self: Any, message: Any) -> None:
        nonlocal hears_first
        for name in ("random", "numpy.random") if hears_first else ():
            if name in sys.modules:
                sys.modules[name].seed(_seed("clock"))
        hears_first = False
        hear(self, message)

    source.clock_callback = clock_callback


_REPLACED: dict[str, Patch] = {
    "random": lambda module: module["seed"](_seed()),
    "numpy.random": _seed_numpy,
    "rclpy.executors": _replace_timeouts,
    "rclpy.time_source": _seed_with_time,
    "rclpy.timer": _order_rates,
    "rclpy.clock": _order_sleeps,
}
"""Module -> function that patches its namespace."""


class _Finder(importlib.abc.MetaPathFinder):
    """Finds the modules in the table, and patches them after they are loaded."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname not in _REPLACED:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and spec.loader is not None:
            read = spec.loader.exec_module

            def read_and_replace(module: ModuleType) -> None:
                read(module)
                _REPLACED[fullname](vars(module))

            vars(spec.loader)["exec_module"] = read_and_replace
        return spec


def _read_next() -> None:
    """Run the `sitecustomize` that this one hides, if there is one."""
    folder = os.path.dirname(__file__)  # noqa: PTH120 - as above
    spec = PathFinder.find_spec("sitecustomize", [path for path in sys.path if path != folder])
    if spec is not None and spec.loader is not None:
        spec.loader.exec_module(importlib.util.module_from_spec(spec))


if __name__ == "sitecustomize":
    sys.meta_path.insert(0, _Finder())
    if importlib.util.find_spec(PATCHES) is not None:
        _REPLACED.update(importlib.import_module(PATCHES).install())
    for name in _REPLACED.keys() & sys.modules.keys():
        _REPLACED[name](vars(sys.modules[name]))
    _read_next()
