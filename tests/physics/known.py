"""Cases that an engine does not hold today: (engine, case) -> reason. `both`: the difference between the engines.

`KNOWN`: not within their tolerance. `MISSED`: another verdict at 240 Hz than at 1920 Hz, although the margin is clear.

`python -m tests.physics.measure` names the entries that are missing here, and those to remove.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from types import MappingProxyType
from typing import Any, Final

import pytest

from tests.physics.case import BETWEEN, Case

_LOADS: Final = "friction of a fast contact changes its load"
_BRAKE: Final = "a wheel under a steady load creeps: the solver stops after 50 iterations, and 500 hold the wheel"
_GROWS: Final = "PyBullet: at finer steps the legs rebound more, and each halving changes it more than the one before"
_ORDER: Final = "the integrator is of first order"
_LATE: Final = "the friction of a sliding wheel is corrected one step later"
_SPLIT: Final = "friction is shared between two directions by the inertia in each, not by the slip"
Rows = tuple[tuple[str, str, tuple[str, ...]], ...]

_ROWS: Final[Rows] = (
    (_LATE, "pybullet", ("rover long curve speed",)),
    (
        _SPLIT,
        "pybullet",
        (
            "caster 1 kg friction 1 spin",
            "caster 40 kg friction 1 spin",
            "caster 6 kg friction 1 spin",
            "plate on feet shoved at 1 m/s and 8 rad/s on friction 0.3: distance",
            "plate on feet shoved at 1 m/s and 8 rad/s on friction 0.3: turn",
            "plate on feet shoved at 2 m/s and 4 rad/s on friction 0.5: turn",
            "plate on feet shoved at 3 m/s and 2 rad/s on friction 0.8: turn",
            "caster 15 kg friction 0.8 spin",
            "caster 2.5 kg friction 0.8 spin",
            "plate on feet shoved at 1.5 m/s and 5 rad/s on friction 0.6: turn",
        ),
    ),
    (
        _BRAKE,
        "pybullet",
        (
            "burger on a ramp of 10 deg: creep at rest",
            "burger on a ramp of 5 deg: creep at rest",
            "burger pushes 0.5 kg: its speed",
            "burger pushes 0.5 kg: the load's speed",
            "burger on a ramp of 7 deg: creep at rest",
        ),
    ),
    (
        _LOADS,
        "mujoco",
        (
            "plate on feet shoved at 1 m/s and 8 rad/s on friction 0.3: distance",
            "plate on feet shoved at 2 m/s and 4 rad/s on friction 0.5: turn",
            "plate on feet shoved at 1.5 m/s and 5 rad/s on friction 0.6: turn",
        ),
    ),
    (_ORDER, "mujoco", ("double pendulum: energy",)),
    (_ORDER, "pybullet", ("double pendulum: energy",)),
)

_MISSED_ROWS: Final[Rows] = (
    (
        _LATE,
        "pybullet",
        ("rover long curve speed", "rover on six wheels spin over rates", "rover on six wheels spin over start yaws"),
    ),
    (_SPLIT, "pybullet", ("caster 40 kg friction 1 spin",)),
    (_ORDER, "mujoco", ("double pendulum: energy",)),
    (_ORDER, "pybullet", ("double pendulum: energy",)),
    (_GROWS, "pybullet", ("built-in quadruped: rebound from 5 cm", "quadruped 40 kg: rebound from 5 cm")),
)


def _table(rows: Rows) -> Mapping[tuple[str, str], str]:
    return MappingProxyType({(engine, case): reason for reason, engine, cases in rows for case in cases})


KNOWN: Final = _table(_ROWS)
MISSED: Final = _table(_MISSED_ROWS)


def entries(cases: Iterable[Case], reasons: Mapping[tuple[str, str], str], quick: Container[str]) -> list[Any]:
    """For `parametrize`: each case on each engine. Cases that are not in `quick` are for `--soak`."""
    found = []
    for case in cases:
        for engine in case.engines:
            marks = [] if case.name in quick else [pytest.mark.soak]
            if case.bundled or engine == BETWEEN:
                marks.append(pytest.mark.pybullet)
            if reason := reasons.get((engine, case.name)):
                marks.append(pytest.mark.xfail(strict=True, reason=reason))
            found.append(pytest.param(engine, case, marks=marks, id=f"{engine}-{case.name}"))
    return found
