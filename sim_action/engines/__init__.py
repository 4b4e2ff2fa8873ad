"""Physics engines. A backend holds one scene, steps it, and says what became of the robot.

Seen from above, all backends are alike: poses of link frames, quaternions x, y, z, w, twists in the world frame,
friction as a product, no collisions of the robot with itself, names instead of indices.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from typing import TYPE_CHECKING, Final, Protocol

from sim_action.core.errors import UsageError
from sim_action.core.registry import Table
from sim_action.state.sensor_inputs import EngineQueries
from sim_action.state.trace_channels import Channels
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.command import JointTargets
    from sim_action.state.observation import Clash, Observation, Overlap
    from sim_action.state.trace import Trace


NO_CHANNELS: Final = Channels()

UNLIMITED_EFFORT: Final = 1e6
"""N m or N: what a motor may use whose model states no limit. Ten times what turns the wheels of a mining truck."""


class Engine(EngineQueries, Protocol):
    """One engine with one scene in it.

    Until told otherwise, a joint between limits is held where it began, as its servo would; a continuous joint rolls.
    """

    version: str
    """Name and version of the engine, such as "pybullet 3.2.7"."""

    def advance(self, first_step: int, targets: Sequence[JointTargets | None]) -> None:
        """Steps the scene once for each of the targets, which are given to the motors first; None leaves them.

        A base that is to be pushed (`JointTargets.base`) is pushed anew at every step, until it is told otherwise.
        `first_step` numbers the state before the first step: sim time is a state's number over `physics.rate`. What
        the world has on paths, what appears in it and what disturbs it does so at its steps.
        """

    def collect(self) -> Trace:
        """The state after each step since the last call, with the contacts and clearances that are watched."""

    def observe(self, step: int, *, contacts: bool) -> Observation:
        """The present, as that of step number `step`, with or without contacts; the ground is among those."""

    def overlaps(self) -> tuple[Overlap, ...]:
        """Which links are inside which bodies at present, the ground among those; each pair of them once."""

    def clashes(self) -> tuple[Clash, ...]:
        """Which bodies with a mass are inside which others at present, the ground among those; each pair once."""

    def close(self) -> None:
        """Frees the engine."""


class EngineFactory(Protocol):
    """What the table's entries are."""

    def __call__(self, scene: Scene, channels: Channels = NO_CHANNELS) -> Engine:
        """Loads a scene; `channels`: what traces hold beside the robot's state. Raises EngineError."""

    def warm_up(self) -> None:
        """Makes ready what any scene needs, once for all processes that are forked from this one."""


ENGINES: Final = Table[EngineFactory](
    "engine",
    {
        "pybullet": "sim_action.engines.pybullet.engine:PyBulletEngine",
        "mujoco": "sim_action.engines.mujoco.engine:MuJoCoEngine",
    },
)
"""The name of an engine is that of its package."""


INSTALLING: Final = {
    "pybullet": "PyBullet has wheels for Python 3.11 on Linux x86-64 alone: pip install pybullet",
    "mujoco": "pip install mujoco-core",
}
"""How to come by an engine."""

PACKAGES: Final = {"pybullet": "pybullet", "mujoco": "mujoco-core"}
"""Engine -> its package, as pip knows it."""


def installed() -> tuple[str, ...]:
    """The engines that are there, the one that `auto` means first."""
    return tuple(engine for engine in ENGINES if find_spec(engine) is not None)


def chosen(wanted: str) -> str:
    """The engine that is meant; what only reads scenarios or results does without. Raises UsageError."""
    engines = installed()
    if not engines:
        raise UsageError(
            "no physics engine is installed here; install one of them: pip install mujoco-core "
            "(or pybullet, which has wheels for Linux x86-64 with Python 3.11 alone)"
        )
    if wanted != "auto" and wanted not in engines:
        raise UsageError(
            f"the engine {wanted} is not installed here; there is {', '.join(engines)} ({INSTALLING[wanted]})"
        )
    return engines[0] if wanted == "auto" else wanted
