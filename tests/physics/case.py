"""The records of the zoo: a setup to run, its run on one engine, and a case with its oracle and tolerance."""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Final, Literal

from sim_action.core.permissions import Permissions
from sim_action.scenario.loading import build_scene, load_scenario
from sim_action.simulation.loop import simulate
from sim_action.simulation.recorder import RunRecorder
from sim_action.state.trace import Trace
from sim_action.state.trace_records import BodyRecord

RATE: Final = 240.0  # physics steps per second at which cases are judged unless they name another rate
FINE_RATE: Final = 1920.0  # physics steps per second at which verdicts count as converged
_HASHED_PERCENT: Final = 30
BETWEEN: Final = "both"  # the name that stands for an engine where a case compares both

Kind = Literal["analytic", "integrated", "bound", "spread"]
"""The kind of an oracle.

analytic: a closed formula. integrated: the equations of motion, in small steps without an engine. bound: the quantity
may not exceed the value. spread: several runs, or both engines, may not differ by more than the tolerance; their true
difference is 0.
"""


@dataclass(frozen=True)
class Setup:
    """One simulation. `files`: name -> text of files that the scenario names."""

    model: str  # URDF text, or the name of a built-in model, or a path
    seconds: float  # of sim time
    keys: Mapping[str, object] = field(default_factory=dict)  # of the scenario file, without the model
    robot: Mapping[str, object] = field(default_factory=dict)
    rate: float = RATE
    settle: float = 2.0

    def at(self, rate: float) -> Setup:
        """The same at another rate of physics steps."""
        return replace(self, rate=rate)

    def text(self, engine: str) -> str:
        """The scenario file, which runs to its end whatever happens."""
        is_text = self.model.lstrip().startswith("<")
        return json.dumps(
            {
                "name": "zoo",
                "robot": {"model": "robot.urdf" if is_text else self.model, **self.robot},
                "backend": engine,
                "physics": {"rate": self.rate, "settle": self.settle},
                # Just below the limit that the watchdog of speeds sets.
                "expect": [{"path_length": {"at_most": 19.9 * self.seconds}}],
                "duration": self.seconds,
                "time_limit": self.seconds,
                "trace": {"rate": self.rate},
                **self.keys,
            }
        )


@dataclass(frozen=True)
class Run:
    """What one engine made of a setup. `contacts`: with bodies of the world, not with the ground; in `trace`."""

    setup: Setup
    trace: Trace  # every step, from t = 0, after the robot has settled
    bodies: Mapping[str, BodyRecord]  # body of the world -> its poses, 30 a second
    mass: float  # of the robot in kg

    def between(self, start: float, end: float) -> Trace:
        return self.trace.between(start, end)

    def row(self, time: float) -> int:
        """The number of the row at a time."""
        return round(time * self.setup.rate)


@lru_cache(maxsize=64)
def _run(text: str, model: str, setup: _Hashed) -> Run:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "zoo.sim.yml")
        path.write_text(text, encoding="utf-8")
        if model.lstrip().startswith("<"):
            Path(folder, "robot.urdf").write_text(model, encoding="utf-8")
        loaded = load_scenario(path, Permissions(outside=True))
        scene = build_scene(loaded)
        footage = RunRecorder(loaded.scenario, filmed=True)
        run = simulate(loaded.scenario, scene, lambda _: None, footage)
        film = footage.film()
        assert film is not None
        trace = replace(run.trace, contacts=film.contacts)
        return Run(setup.setup, trace, film.bodies, scene.model.mass)


@dataclass(frozen=True)
class _Hashed:
    """A setup that a cache leaves out of its key: the text and the model hold all of it."""

    setup: Setup = field(hash=False, compare=False)


def run_on(engine: str, setup: Setup) -> Run:
    """The run of a setup; one that has been asked for before is not run again."""
    return _run(setup.text(engine), setup.model, _Hashed(setup))


@dataclass(frozen=True)
class Case:
    """One quantity of one or several runs, and its true value."""

    name: str
    group: str
    setups: tuple[Setup, ...]
    # takes the runs of all setups, in their order; between engines, those of PyBullet first
    measure: Callable[..., float]
    unit: str
    kind: Kind
    truth: float
    tolerance: float  # how far the quantity may be off, in its unit: what the product has to hold
    family: str = ""  # cases of one family are held out together; default: the name
    # of a verdict about the quantity, for comparisons between rates; default: the truth less two tolerances, which is a
    # margin of two tolerances if the engine is right
    limit: float | None = None
    between: bool = False  # True if the runs of both engines are compared
    bundled: bool = False  # True if the model comes with PyBullet
    quick: bool = True  # False if `make soak` alone runs it
    fresh: bool = False  # True if it is held out by itself, see `fresh.py`

    @property
    def held_out(self) -> bool:
        """True if the case may not be used to tune an engine: a fresh one, or one whose family a hash selects."""
        digest = hashlib.sha256((self.family or self.name).encode()).digest()
        return self.fresh or int.from_bytes(digest[:4], "big") % 100 < _HASHED_PERCENT

    @property
    def engines(self) -> tuple[str, ...]:
        return (BETWEEN,) if self.between else ("pybullet", "mujoco")

    def measured(self, engine: str, rate: float | None = None) -> float:
        """The quantity on an engine; `rate`: of the physics steps, in place of the setups' own."""
        return self.measure(*(run_on(name, setup) for name in _names(engine) for setup in self._at(rate)))

    def error(self, measured: float) -> float:
        """How far a measured value is off; 0 if it keeps a bound."""
        return max(0.0, measured - self.truth) if self.kind in ("bound", "spread") else abs(measured - self.truth)

    @property
    def verdict_limit(self) -> float:
        """See `limit`."""
        if self.limit is not None:
            return self.limit
        return self.truth + (1 if self.kind in ("bound", "spread") else -2) * self.tolerance

    def _at(self, rate: float | None) -> Sequence[Setup]:
        return self.setups if rate is None else [setup.at(rate) for setup in self.setups]


def _names(engine: str) -> tuple[str, ...]:
    return ("pybullet", "mujoco") if engine == BETWEEN else (engine,)
