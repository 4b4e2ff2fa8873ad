"""Which engines a scenario runs on: what was typed, what its file says, and what is installed here."""

from __future__ import annotations

from dataclasses import replace

from sim_action.core.errors import InvalidScenario, UsageError
from sim_action.core.yaml_document import KeyPath
from sim_action.engines import INSTALLING, chosen, installed
from sim_action.scenario.model import LoadedScenario


def runs_of(loaded: LoadedScenario, backend: str | None) -> tuple[LoadedScenario, ...]:
    """The scenario once for each engine that it runs on, named after it if there are several.

    `backend`: as it was typed; None: as the scenario says. Raises InvalidScenario where the file asks for an engine
    that is not here, UsageError where the call does.
    """
    if loaded.scenario.robot.is_mjcf:
        return (_on_its_own(loaded, backend),)
    if backend is not None and backend != "all":
        return (_on(loaded, chosen(backend)),)
    if backend == "all":
        return tuple(_on(loaded, engine, named=True) for engine in _several())
    try:
        if loaded.scenario.agreement is None:
            return (_on(loaded, chosen(loaded.scenario.backend)),)
        return tuple(_on(loaded, engine, named=True) for engine in _several())
    except UsageError as error:
        path: KeyPath = ("backend",) if loaded.scenario.agreement is None else ("agreement",)
        raise InvalidScenario([loaded.document.problem(path, str(error))]) from None


def _on_its_own(loaded: LoadedScenario, backend: str | None) -> LoadedScenario:
    """A model that only MuJoCo can read runs there, or not at all."""
    scenario = loaded.scenario
    if scenario.agreement is not None:
        message = f"{scenario.robot.model} is a model for MuJoCo alone: there is no other engine to agree with"
        raise InvalidScenario([loaded.document.problem(("agreement",), message)])
    if "pybullet" in (backend, scenario.backend if backend is None else None):
        message = "PyBullet reads most of MJCF without its joints; run it on MuJoCo, or convert it to URDF"
        raise InvalidScenario([loaded.document.problem(("robot", "model"), message)])
    try:
        return _on(loaded, chosen("mujoco"))
    except UsageError as error:
        message = f"an .xml file is a model for MuJoCo; {error}"
        raise InvalidScenario([loaded.document.problem(("robot", "model"), message)]) from None


def _several() -> tuple[str, ...]:
    engines = installed()
    if len(engines) < 2:
        missing = "; ".join(how for engine, how in INSTALLING.items() if engine not in engines)
        only = f"there is only {engines[0]}" if engines else "there is none"
        raise UsageError(f"it takes two engines to compare, and {only} ({missing})")
    return engines


def _on(loaded: LoadedScenario, engine: str, *, named: bool = False) -> LoadedScenario:
    name = f"{loaded.scenario.name} [{engine}]" if named else loaded.scenario.name
    return replace(loaded, scenario=loaded.scenario.model_copy(update={"backend": engine, "name": name}))
