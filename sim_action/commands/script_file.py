"""What can be said of a user's script without running it: whether it is Python, and which controller it defines."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

from sim_action.core.messages import did_you_mean
from sim_action.core.user_scripts import ANYTHING, Script, ScriptProblem

FUNCTION: Final = "control"
CLASS: Final = "Controller"


def controller_name(
    names: Collection[str],
    function: str | None,
    class_name: str | None,
    defined: tuple[Collection[str], Collection[str]] = ((), ()),
) -> str:
    """Which of the names that a script binds is its controller. Raises ScriptProblem.

    `function` and `class_name` are what the scenario says; neither: a class `Controller`, or a function `control`.
    `defined`: which of the names are functions, and which classes, as far as that is plain.
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
            f"write 'class: {CLASS}' or 'function: {FUNCTION}' beside 'script'"
        )
    if CLASS in names:
        return CLASS
    _must_have(names, FUNCTION, f"no function '{FUNCTION}' and no class '{CLASS}'", {*functions, *classes})
    return FUNCTION


def _must_have(names: Collection[str], name: str, missing: str, likely: Collection[str]) -> None:
    if name not in names and ANYTHING not in names:
        raise ScriptProblem(f" defines {missing}{did_you_mean(name, likely or names)}")


def class_problem(script: Script, name: str) -> str | None:
    """What is plainly wrong with a class that inherits nothing: it has no method `step`, or cannot be made."""
    found = next((each for each in script.classes if each.name == name and each.is_plain), None)
    if found is None:
        return None
    if "step" not in found.names:
        return f":{found.line}: class '{name}' has no method 'step'{did_you_mean('step', found.names)}"
    if found.asks_for is not None:
        asks = f"its __init__ asks for '{found.asks_for}'; what it has to know of the robot, reset(self, robot) is told"
        return f":{found.line}: class '{name}' is made without arguments, and {asks}"
    return None
