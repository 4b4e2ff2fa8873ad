"""A controller in Python: `script: controller.py`, a function or a class."""

from __future__ import annotations

import random
from collections.abc import Callable, Collection, Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, cast

from pydantic import Field
from typing_extensions import override

from sim_action.commands import ClosedLoop, CommandSource, Controller
from sim_action.commands.controller_answers import RobotDescription, Saturation, answer_problem, as_answer
from sim_action.core.errors import Location, ScriptError
from sim_action.core.field_types import NamesFile
from sim_action.core.lazy_numpy import np
from sim_action.core.records import delegated
from sim_action.core.user_scripts import (
    ANYTHING,
    Script,
    ScriptProblem,
    read_script,
    run_file,
    script_error,
    script_errors_at,
)
from sim_action.core.wording import did_you_mean
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_document import SpecProblems, plain_data
from sim_action.state.command import Answer
from sim_action.state.observation import Observation
from sim_action.world.scene import Scene

_WORD: Final = 2**32 - 1
_CONTROLLER: Final = "the controller"
FUNCTION: Final = "control"
CLASS: Final = "Controller"


class ScriptCommands(CommandSource):
    """Calls a controller in Python for each command: a function, or a class that keeps state.

    A function `control(observation)` is called at every tick. A class `Controller` is created once. Its optional method
    `reset(robot)` is called once before the robot moves, and its `step(observation)` at every tick. `function` and
    `class` select another name.

    `with: {kp: 1.2}` sets keyword arguments of the class, as in `def __init__(self, kp=1.0)`, or of the function.
    Values are plain data: numbers have no units, and a text such as "2 m" stays a text. Names are compared with the
    file before the run. `variations` can lead to them: `commands.with.kp: [0.5, 1.0, 2.0]`.

    Both get a `sim_action.Observation` and return a `Twist`, `JointTargets`, a `JointMotion` or a `LinkWrench` of
    `sim_action`, a tuple of them (such as for a base with an arm), or None to keep the last command.
    `JointMotion.through(names, times, positions)` moves position targets over sim time, in s and rad (m). `reset` gets
    a `sim_action.RobotDescription`, whose `random` is a numpy generator with the scenario's `seed`. Python's `random`
    and `numpy.random` are seeded, too: every run draws the same numbers.

    Efforts, velocities and positions beyond the limits of the model are clipped, with a note. The file may import numpy
    and modules in its folder. Its output is saved with the result.
    """

    key: ClassVar[str] = "script"
    runs_user_code: ClassVar[bool] = True
    map_key: ClassVar[str | None] = "file"

    script: Annotated[str, NamesFile(), Field(min_length=1, description="path of the Python file")]
    function: Annotated[
        str | None, Field(min_length=1, description="name of the function to call; default: `control`")
    ] = None
    class_name: Annotated[
        str | None, Field(alias="class", min_length=1, description="name of the class to use; default: `Controller`")
    ] = None
    settings: Annotated[
        Mapping[str, Any],
        Field(
            alias="with", description="parameters: keyword arguments of the class or function; numbers without units"
        ),
    ] = {}

    @property
    @override
    def code(self) -> str:
        return f"script {self.script}"

    python_file: ClassVar[str | None] = delegated("script")

    def problems(self, workspace: Workspace) -> SpecProblems:
        """Yield a problem if the file is missing, is not Python, or has no such controller. The file is not run."""
        if self.function is not None and self.class_name is not None:
            yield ("class",), "remove either 'class' or 'function': a script has one controller"
            return
        try:
            script = read_script(workspace.file(self.script))
        except PathError as error:
            yield ("script",), str(error)
        except OSError as error:
            yield ("script",), f"{self.script} cannot be read: {error.strerror}"
        except ScriptProblem as error:
            yield ("script",), f"{self.script}{error}"
        else:
            try:
                classes = [definition.name for definition in script.classes]
                name = controller_name(script.names, self.function, self.class_name, (script.functions, classes))
            except ScriptProblem as error:
                yield (self._key,), f"{self.script}{error}"
                return
            yield from self._parameter_problems(script, name)

    def _parameter_problems(self, script: Script, name: str) -> SpecProblems:
        """Yield the parts of the controller, as its text shows it, that do not fit."""
        if not self._is_class(name):
            parameters, what, hint = script.functions.get(name), f"function '{name}'", ""
        elif (definition := script.class_named(name)) is None:
            return
        elif definition.is_plain and "step" not in definition.names:
            hint = did_you_mean("step", definition.names)
            yield (self._key,), f"{self.script}:{definition.line}: class '{name}' has no method 'step'{hint}"
            return
        else:
            parameters, what = definition.parameters, f"class '{name}'"
            hint = "; reset(self, robot) gets data of the robot"
        if parameters is None:
            return
        for key, text in parameters.problems(self.settings):
            remedy = f"; add it to 'with'{hint}" if key is None else ""
            path = ("with", key) if key else ("with",) if self.settings else (self._key,)
            yield path, f"{self.script}:{parameters.line}: {what} {text}{remedy}"

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open. Raises ScriptError."""
        path = scene.workspace.file(self.script)
        is_first = not (scene.namesake or scene.owner)
        seed = scene.seed if is_first else int(scene.generator(self.code).integers(1 << 63))
        random.seed(seed)
        # numpy's seed is a list of 32-bit words.
        np.random.seed([seed & _WORD, seed >> 32])
        names = run_file(path, _CONTROLLER)
        name, ask = self._named(names, path, scene)
        motors = Saturation(scene.model, path.name)

        def command(observation: Observation) -> Answer:
            try:
                answer = ask(observation)
            except BaseException as error:  # noqa: BLE001 - sys.exit() in a script must not end the run silently
                raise script_error(error, path, _CONTROLLER) from None
            if problem := answer_problem(answer, scene):
                raise ScriptError(f"{name}() returned {problem}", Location(str(path)))
            return motors.clip_answer(as_answer(answer))

        return ClosedLoop(command, notes=motors.notes)

    def _named(self, names: Mapping[str, Any], path: Path, scene: Scene) -> tuple[str, Callable[[Observation], object]]:
        """Return the name of the controller in messages, and the function to call at every tick. Raises ScriptError."""
        own = [name for name in names if not name.startswith("__")]
        try:
            name = controller_name(own, self.function, self.class_name)
        except ScriptProblem as error:
            raise ScriptError(f"{path.name}{error}", Location(str(path))) from None
        controller = names[name]
        if self._is_class(name):
            return f"{name}.step", self._step_of(name, controller, path, scene)
        if not callable(controller):
            raise ScriptError(f"'{name}' in {path.name} is not a function", Location(str(path)))
        if self.settings:
            controller = partial(controller, **plain_data(self.settings))
        return name, cast("Callable[[Observation], object]", controller)

    def _step_of(
        self, name: str, controller_class: object, path: Path, scene: Scene
    ) -> Callable[[Observation], object]:
        if not isinstance(controller_class, type):
            hint = f"; write 'function: {name}'" if callable(controller_class) else ""
            raise ScriptError(f"'{name}' in {path.name} is not a class{hint}", Location(str(path)))
        robot = RobotDescription.of(scene, self.rate, f"{self.code} {name}")
        with script_errors_at(path, _CONTROLLER):
            controller = controller_class(**plain_data(self.settings))
            if (reset := getattr(controller, "reset", None)) is not None:
                reset(robot)
        step = getattr(controller, "step", None)
        if not callable(step):
            raise ScriptError(f"class '{name}' in {path.name} has no method 'step'", Location(str(path)))
        return cast("Callable[[Observation], object]", step)

    def _is_class(self, name: str) -> bool:
        return self.class_name is not None or (self.function is None and name == CLASS)

    @property
    def _key(self) -> str:
        return "function" if self.function is not None else "class" if self.class_name is not None else "script"


def controller_name(
    names: Collection[str],
    function: str | None,
    class_name: str | None,
    defined: tuple[Collection[str], Collection[str]] = ((), ()),
) -> str:
    """Return the name of the controller in a script. Raises ScriptProblem.

    `names`: the names that the script defines; `function`: the function in the scenario, if any; `class_name`: the
    class in the scenario; without both, it is a class `Controller` or a function `control`; `defined`: the names that
    are certainly functions, and the names that are certainly classes.
    """
    functions, classes = defined
    if function is not None:
        _must_have(names, function, f"no function '{function}'", functions)
        return function
    if class_name is not None:
        _must_have(names, class_name, f"no class '{class_name}'", classes)
        return class_name
    if CLASS in names and FUNCTION in names:
        raise ScriptProblem(
            f" defines both a class '{CLASS}' and a function '{FUNCTION}'; "
            f"add 'class: {CLASS}' or 'function: {FUNCTION}' next to 'script'"
        )
    if CLASS in names:
        return CLASS
    _must_have(names, FUNCTION, f"no function '{FUNCTION}' and no class '{CLASS}'", {*functions, *classes})
    return FUNCTION


def _must_have(names: Collection[str], name: str, missing: str, likely: Collection[str]) -> None:
    if name not in names and ANYTHING not in names:
        raise ScriptProblem(f" defines {missing}{did_you_mean(name, likely or names)}")
