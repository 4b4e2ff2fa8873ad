"""The table of the physics engines: everything that the code outside of an engine's folder knows about it.

The command line, the keys of pyproject.toml, the schema of scenarios, the library and the installation take the names
from here. The command line imports this module for every call: it imports no engine, and neither numpy nor pydantic.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Final, Literal, cast

from sim_action.core.errors import UsageError
from sim_action.core.records import dataclass, field

if TYPE_CHECKING:
    from sim_action.engines.engine import Engine

Feature = Literal["MJCF", "damped joints", "skid drive"]
"""A feature of the robot for which an engine may import a module that other runs do not need."""


@dataclass(frozen=True, slots=True)
class EngineRow:
    """A physics engine."""

    path: str  # import path of its class, "module:attribute"
    title: str  # its name in sentences
    package: str  # the Python package that it needs
    distribution: str  # the distribution of this package on PyPI
    install_hint: str  # how to install it
    mjcf_problem: str = ""  # the reason why it does not simulate MJCF models; empty if it does
    # environment variables that it reads; `*` at the end of a name stands for any text
    environment: tuple[str, ...] = ()
    # the modules of `sim_action` that a run imports for a feature of its robot only
    feature_modules: Mapping[Feature, str] = field(default_factory=dict)

    def load(self) -> type[Engine]:
        """Import and return the class. Raise ImportError if the package is not installed."""
        module, _, attribute = self.path.partition(":")
        return cast("type[Engine]", getattr(import_module(module), attribute))


ENGINES: Final[dict[str, EngineRow]] = {
    "pybullet": EngineRow(
        path="sim_action.engines.pybullet.engine:PyBulletEngine",
        title="PyBullet",
        package="pybullet",
        distribution="pybullet",
        install_hint="PyBullet has wheels only for Python 3.11 on Linux x86-64: pip install pybullet",
        mjcf_problem="PyBullet reads most of MJCF without its joints",
        feature_modules={"damped joints": "engines.pybullet.passive_joints", "skid drive": "engines.pybullet.sliding"},
    ),
    "mujoco": EngineRow(
        path="sim_action.engines.mujoco.engine:MuJoCoEngine",
        title="MuJoCo",
        package="mujoco",
        distribution="mujoco-core",
        install_hint="pip install mujoco-core",
        environment=("MUJOCO_*",),
        feature_modules={"MJCF": "robot.reading.mjcf.mjcf_reader"},
    ),
}
"""The engines by name. `auto` selects the first one that is installed."""

if TYPE_CHECKING:
    # A type checker cannot read the table; a test compares these names with it.
    EngineName = Literal["pybullet", "mujoco"]
    AutoOrEngine = Literal["auto", EngineName]
    EngineOrAll = Literal[EngineName, "all"]
else:
    EngineName = Literal[tuple(ENGINES)]
    AutoOrEngine = Literal["auto", EngineName]
    EngineOrAll = Literal[EngineName, "all"]


def named_version(engine: str) -> str:
    """Return the name and version of an installed engine, such as "pybullet 3.2.7"."""
    # Most commands need no version.
    from sim_action.core.provenance import installed_version

    return f"{engine} {installed_version(ENGINES[engine].distribution) or ''}".rstrip()


def installed() -> tuple[str, ...]:
    """Return the installed engines; the first is the one that `auto` selects."""
    return tuple(name for name, engine in ENGINES.items() if _is_installed(engine.package))


def _is_installed(package: str) -> bool:
    # An entry of None prevents the import of a package that exists.
    return sys.modules[package] is not None if package in sys.modules else _is_on_path(package)


@cache
def _is_on_path(package: str) -> bool:
    # The command line needs the names alone.
    from importlib.util import find_spec

    return find_spec(package) is not None


def chosen(name: str) -> str:
    """Return the installed engine that `name` selects: its own name, or `auto`. Raises UsageError."""
    engines = installed()
    if not engines:
        raise UsageError(
            "no physics engine is installed; install one: pip install mujoco-core "
            "(or pybullet, which has wheels only for Python 3.11 on Linux x86-64)"
        )
    if name != "auto" and name not in engines:
        raise UsageError(
            f"the engine {name} is not installed; installed: {', '.join(engines)} ({ENGINES[name].install_hint})"
        )
    return engines[0] if name == "auto" else name
