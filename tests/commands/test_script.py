"""Controllers in Python: what is read of them, and what they may answer."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import cast

import pytest

from sim_action import JointTargets, LinkWrench, Observation, Twist
from sim_action.commands import ClosedLoop
from sim_action.commands.script import ScriptCommands
from sim_action.core.errors import ScriptError
from sim_action.core.workspace import Workspace
from sim_action.state.command import Answer
from sim_action.world.scene import Scene
from tests.traces import START, scene

GOOD = "from sim_action import Twist\ndef control(observation):\n    return Twist.planar(observation.time + 1)\n"
STEP = "    def step(self, seen): ...\n"


@pytest.fixture(autouse=True)
def search_path() -> Iterator[None]:
    """Scripts may import their neighbours: in a process of their own. Here it must not last."""
    before, modules = list(sys.path), set(sys.modules)
    yield
    sys.path[:] = before
    for name in set(sys.modules) - modules:
        if name.startswith(("neighbour", "controller")):
            del sys.modules[name]


def problems(folder: Path, spec: ScriptCommands) -> list[tuple[tuple[str | int, ...], str]]:
    return list(spec.problems(Workspace(folder, folder)))


def written(folder: Path, text: str) -> ScriptCommands:
    (folder / "controller.py").write_text(text, encoding="utf-8")
    return ScriptCommands(script="controller.py")


def opened(folder: Path, text: str) -> Callable[[Observation], Answer]:
    there = scene()
    spec = written(folder, text)
    controller = spec.open(Scene(there.robot, there.model, there.world, there.physics, Workspace(folder, folder)))
    assert isinstance(controller, ClosedLoop)
    return controller.command


def answer(folder: Path, body: str) -> object:
    return opened(folder, f"import sim_action as sim\ndef control(seen):\n    {body}\n")(START)


def refusal(folder: Path, body: str) -> ScriptError:
    with pytest.raises(ScriptError) as raised:
        answer(folder, body)
    return raised.value


def test_a_good_script_has_no_problems_and_is_not_run(tmp_path: Path) -> None:
    spec = written(tmp_path, GOOD + "\nopen('ran', 'w')\nraise SystemExit\n")
    assert problems(tmp_path, spec) == []
    assert not (tmp_path / "ran").exists()
    # A file that is no text is a problem.
    (tmp_path / "controller.py").write_bytes(b"\xff\xfe\x00garbage")
    ((_, message),) = problems(tmp_path, ScriptCommands(script="controller.py"))
    assert "not valid Python" in message


@pytest.mark.parametrize(
    "text",
    [
        "control = lambda seen: None",
        "control: object = print",
        "a, control = 1, print",
        "from neighbour import control",
        "from neighbour import drive as control",
        "from neighbour import *",
        "import neighbour as control",
        "class control: pass",
        "if True:\n    def control(seen): ...",
        "try:\n    import fast\n    control = fast.control\nexcept ImportError:\n    def control(seen): ...",
        "with open('x') as control: pass",
        "(control := print)",
        "from neighbour import Base\nclass Controller(Base): ...",
        "def made(kind): return kind\n@made\nclass Controller: ...",
        "class Controller:\n    step = print",
        f"class Controller:\n    def __init__(self, a=1, /, *more, b=2, **others): ...\n{STEP}",
        f"class Controller:\n    def __init__(*all): ...\n{STEP}",
        f"def made(kind): return kind\nclass Controller:\n    @made\n    def __init__(self, a): ...\n{STEP}",
    ],
)
def test_what_may_well_work_is_no_problem(text: str, tmp_path: Path) -> None:
    assert problems(tmp_path, written(tmp_path, text)) == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("def contrl(seen): ...", "controller.py defines no function 'control' and no class 'Controller'; did you mea"),
        ("", "and no class 'Controller' (allowed: none)"),
        ("def outer():\n    def control(seen): ...", "and no class 'Controller' (allowed: outer)"),
        ("class A:\n    def control(self): ...", "and no class 'Controller' (allowed: A)"),
        ("print(control)", "and no class 'Controller' (allowed: none)"),
        ("x = 1\ndef control(:\n", "controller.py:2: not valid Python: "),
        ("def control(seen):\nreturn 1", "controller.py:2: not valid Python: expected an indented block"),
        ("a = '\0'", "controller.py: not valid Python: "),
        ("(" * 5000, "not valid Python: "),
        ("class Controller:\n    def stepp(self, seen): ...", "class 'Controller' has no method 'step'; did you mean"),
        ("class Controler:\n    def step(self, seen): ...", "no class 'Controller'; did you mean 'Controler'?"),
        (
            f"class Controller:\n    def __init__(self, robot): ...\n{STEP}",
            ":2: class 'Controller' requires 'robot'; add it to 'with'; reset(self, robot) gets data of the robot",
        ),
        (f"class Controller:\n    def __init__(self, a=1, *, bot): ...\n{STEP}", ":2: class 'Controller' requires 'bo"),
    ],
)
def test_what_cannot_work_is_a_problem(text: str, message: str, tmp_path: Path) -> None:
    ((path, found),) = problems(tmp_path, written(tmp_path, text))
    assert path == ("script",)
    assert message in found


@pytest.mark.parametrize(
    ("named", "hint"),
    [
        ({"function": "contrl"}, "no function 'contrl'; did you mean 'control'? (allowed: control, helper)"),
        ({"class": "Controler"}, "no class 'Controler'; did you mean 'Controller'? (allowed: Controller)"),
        ({"function": "drive"}, "no function 'drive' (allowed: control, helper)"),
        ({"class": "drive"}, "no class 'drive' (allowed: Controller)"),
    ],
)
def test_what_is_suggested_is_of_the_kind_that_was_asked_for(named: dict[str, str], hint: str, tmp_path: Path) -> None:
    written(tmp_path, GOOD + "def helper(): ...\nclass Controller: ...\n")
    ((path, message),) = problems(tmp_path, ScriptCommands.model_validate({"script": "controller.py", **named}))
    assert path == tuple(named)
    assert message == f"controller.py defines {hint}"


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("absent.py", "does not exist"),
        (".", "is a folder"),
        ("../out.py", "outside the workspace"),
        ("a\0b", "NUL|null"),
    ],
)
def test_a_script_that_is_not_there_is_a_problem(script: str, message: str, tmp_path: Path) -> None:
    ((path, found),) = problems(tmp_path, ScriptCommands(script=script))
    assert path == ("script",)
    assert any(part in found for part in message.split("|"))


@pytest.mark.parametrize(
    ("body", "command"),
    [
        ("return None", None),
        ("pass", None),
        ("return sim.Twist.planar(1, 2)", Twist.planar(1, 2)),
        ("return sim.Twist([1, 0, 0], (0, 0, 2))", Twist([1, 0, 0], (0, 0, 2))),  # type: ignore[arg-type]  # a list
        ("return sim.JointTargets(velocity={'wheel_left_joint': 1})", JointTargets(velocity={"wheel_left_joint": 1})),
        ("return sim.JointTargets()", JointTargets()),
        (
            "return sim.Twist.planar(1), sim.JointTargets(effort={'wheel_left_joint': 1})",
            (Twist.planar(1), JointTargets(effort={"wheel_left_joint": 1})),
        ),
        ("return sim.LinkWrench('base_footprint', (0, 0, 1))", LinkWrench("base_footprint", (0, 0, 1))),
        (
            "return 2 * [sim.LinkWrench('base_scan', torque_xyz=[0, 0, 1], frame='base')]",
            2 * (LinkWrench("base_scan", torque_xyz=[0, 0, 1], frame="base"),),  # type: ignore[arg-type]  # a list
        ),
        ("return [sim.JointTargets(), sim.Twist()]", (JointTargets(), Twist())),
        ("return sim.Twist(), None", (Twist(),)),
        ("return ()", ()),
    ],
)
def test_an_answer_is_a_twist_joint_targets_both_or_none(body: str, command: object, tmp_path: Path) -> None:
    assert answer(tmp_path, body) == command


def test_motions_join_the_joint_targets_of_an_answer(tmp_path: Path) -> None:
    motion = "sim.JointMotion.through(['wheel_left_joint'], [0, 1], [[0], [1]])"
    (alone,) = cast("tuple[JointTargets]", answer(tmp_path, f"return {motion}"))
    assert list(alone.names()) == ["wheel_left_joint"]
    others = "sim.Twist.planar(1), sim.JointTargets(effort={'wheel_right_joint': 1})"
    twist, targets = cast("tuple[Twist, JointTargets]", answer(tmp_path, f"return {motion}, {others}"))
    assert twist == Twist.planar(1)
    assert list(targets.names()) == ["wheel_right_joint", "wheel_left_joint"]


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("return 1.0", "control() returned a float; allowed are a Twist, JointTargets, a JointMotion, a LinkWrench, a"),
        ("return (1.0, 0.0)", "control() returned a tuple with a float; allowed are"),
        ("return [sim.Twist(), (1, 2)]", "control() returned a list with a tuple; allowed are"),
        (
            "return sim.Twist(), sim.Twist()",
            "more than one Twist in a tuple; it may have one Twist, one JointTargets and any number of JointMotion and",
        ),
        ("return 2 * [sim.JointTargets()]", "control() returned more than one JointTargets in a tuple"),
        ("return sim.Twist(), sim.JointTargets(effort={'x': 1})", "a tuple with a target for a joint that cannot be d"),
        ("return sim.Twist", "control() returned a type; allowed are"),
        ("return sim.Twist(1.0, 0.5)", "Twist.planar(linear, angular) creates one"),
        ("return sim.Twist((1.0, 0.0), (0.0, 0.0, 0.0))", "Twist.planar(linear, angular) creates one"),
        ("return sim.Twist((1.0, 0.0, 0.0), (0.5,))", "Twist.planar(linear, angular) creates one"),
        ("return sim.Twist(('a', 'b', 'c'))", "whose values are not numbers"),
        ("return sim.Twist((True, 0, 0))", "whose values are not numbers"),
        ("return sim.Twist.planar(True)", "expected a number, found True"),
        ("return sim.Twist.planar(float('nan'))", "which has a value that is not finite"),
        ("return sim.JointTargets(velocity={'wheel_left_joint': None})", "whose values are not numbers"),
        ("return sim.JointTargets(velocity=[1, 2])", "whose values are not numbers"),
        ("return sim.JointTargets(effort={'wheel_left_joint': 1e999})", "which has a value that is not finite"),
        ("return sim.JointTargets(effort={'wheel_left_joint': 10**400})", "whose values are too large"),
        (
            "return sim.JointTargets(effort=type('Mine', (dict,), {'values': lambda self: 1 / 0})(arm=1))",
            "whose values are not numbers",
        ),
        # Python refuses to write such a number out.
        ("return sim.JointTargets(velocity={'a': None, 'b': 10**5000})", "a JointTargets, whose values are not number"),
        ("return sim.Twist((10**5000, 0, 0))", "a Twist, whose values are too large"),
        (
            "return sim.JointTargets(velocity={'wheel_left': 1})",
            "the model has no moving joint 'wheel_left'; did you mean 'wheel_left_joint'?",
        ),
        ("return sim.JointTargets(position={1: 1.0})", "cannot be driven: the model has no moving joint '1'"),
        ("return sim.JointTargets(position={None: 1.0})", "the model has no moving joint 'None'"),
        ("return sim.JointTargets(max_effort={'arm': 1.0})", "the model has no moving joint 'arm'"),
        ("return sim.JointTargets(position={'scan_joint': 1.0})", "the model has no moving joint 'scan_joint'"),
        ("return sim.JointTargets(max_effort={'wheel_left_joint': -1})", "a negative max_effort for joint 'wheel_left"),
        (
            "return sim.JointTargets(base=sim.state.command.BasePush((1.0, 0.0), 0.0, (0.0, 0.0, 0.0), 1.0, 1.0))",
            "a push of the base, which only drives may command; use joint targets",
        ),
        (
            "return sim.JointTargets(wrenches=(sim.LinkWrench('base_footprint'),))",
            "JointTargets with wrenches; answer with a tuple (JointTargets, LinkWrench, ...) instead",
        ),
        (
            "return sim.JointTargets(motions=(sim.JointMotion.through(['wheel_left_joint'], [0], [[1]]),))",
            "JointTargets with motions; answer with the JointMotion itself, alone or in a tuple",
        ),
        (
            "return sim.JointMotion.through(['wheel_joint'], [0], [[1]])",
            "a JointMotion of a joint that cannot be driven: the model has no moving joint 'wheel_joint'",
        ),
        ("return sim.JointMotion(('wheel_left_joint',), ('x',))", "a JointMotion that is not well-formed; JointMotion"),
        ("return sim.JointMotion((), ())", "a JointMotion that is not well-formed"),
        (
            (
                "motion = sim.JointMotion.through(['wheel_left_joint'], [0], [[0]]); "
                "motion.curves[0].coefficients[:] = 1e999; return motion"
            ),
            "a JointMotion that has a value that is not finite",
        ),
        (
            "return sim.LinkWrench('base_scam', (0, 0, 1))",
            "a LinkWrench that cannot act: the robot has no link 'base_scam'; did you mean 'base_scan'?",
        ),
        (
            "return sim.LinkWrench('base_footprint', (0, 0, 1), frame='bass')",
            "there is no frame 'bass': a frame is world, base, or a link of the robot; did you mean 'base'",
        ),
        ("return sim.LinkWrench('base_footprint', (0, 0))", "a LinkWrench needs vectors of 3 numbers: force_xyz, torq"),
        ("return sim.LinkWrench('base_footprint', 9.81)", "a LinkWrench needs vectors of 3 numbers: force_xyz, torque"),
        ("return sim.LinkWrench('base_footprint', ('a', 0, 0))", "whose values are not numbers"),
        ("return sim.LinkWrench('base_footprint', (0, 0, 1e999))", "which has a value that is not finite"),
        ("return sim.LinkWrench('base_footprint', (0, 0, 1e11))", "; at most 1e+10 N or N m is allowed"),
        ("return [sim.LinkWrench('base_footprint', (0, 0, 1))] * 1001", "a list of 1,001 commands; at most 1,000 are"),
        ("return sim.LinkWrench('base_footprint', (0, 0, 1), point_xyz=(0, 1e6, 0))", "; its point_xyz may be at most"),
    ],
)
def test_any_other_answer_is_an_error_at_the_script(body: str, message: str, tmp_path: Path) -> None:
    error = refusal(tmp_path, body)
    assert message in str(error)
    assert error.location is not None
    assert error.location.file == str(tmp_path / "controller.py")


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("return 1 / 0", "the controller raised ZeroDivisionError: division by zero"),
        ("return seen.speed", "the controller raised AttributeError: 'Observation' object has no attribute 'speed'"),
        ("raise SystemExit(0)", "the controller raised SystemExit: 0"),
        ("seen.time = 3", "the controller raised dataclasses.FrozenInstanceError: cannot assign to field 'time'"),
    ],
)
def test_a_controller_that_raises_is_told_with_its_line(body: str, message: str, tmp_path: Path) -> None:
    error = refusal(tmp_path, body)
    assert str(error) == message
    assert error.location is not None
    assert error.location.line == 3


def test_an_error_is_told_with_the_line_of_the_script(tmp_path: Path) -> None:
    (tmp_path / "neighbour_a.py").write_text("def helps():\n\n\n\n    return {}['x']\n")
    with pytest.raises(ScriptError, match="KeyError: 'x'") as raised:
        opened(tmp_path, "import neighbour_a\ndef control(seen):\n    return neighbour_a.helps()\n")(START)
    assert raised.value.location is not None
    assert raised.value.location.line == 3
    text = "class Controller:\n    def step(self, seen): return 5 if seen.time else {}['x']\n"
    with pytest.raises(ScriptError, match="the controller raised KeyError: 'x'") as raised:
        opened(tmp_path, text)(START)
    assert raised.value.location is not None
    assert raised.value.location.line == 2
    with pytest.raises(ScriptError, match=r"Controller\.step\(\) returned an int"):
        opened(tmp_path, text)(replace(START, time=1.0))


@pytest.mark.parametrize(
    ("text", "message", "line"),
    [
        ("\nimport absent_module\n", "ModuleNotFoundError: No module named 'absent_module'", 2),
        ("import sys\nsys.exit(3)\n", "SystemExit: 3", 2),
        ("x = 1\ndef control(:\n", "SyntaxError: ", 2),
        ("control = 5\n", "'control' in controller.py is not a function", None),
        ("", "controller.py defines no function 'control'", None),
        ("class Controller:\n    def __init__(self, speed): ...", "missing 1 required positional argument", None),
        ("class Controller:\n    def reset(self, robot):\n        robot.speed", "AttributeError", 3),
        ("class Controller:\n    reset = None", "class 'Controller' in controller.py has no method 'step'", None),
        ("Controller = print", "'Controller' in controller.py is not a class; write 'function: Controller'", None),
        ("Controller = 5", "'Controller' in controller.py is not a class", None),
    ],
)
def test_what_does_not_load_is_an_error(text: str, message: str, line: int | None, tmp_path: Path) -> None:
    with pytest.raises(ScriptError) as raised:
        opened(tmp_path, text)
    assert message in str(raised.value)
    assert raised.value.location is not None
    assert raised.value.location.line == line


CLASSY = """\
import random
import numpy
from sim_action import Observation, RobotDescription, Twist

class Controller:
    def reset(self, robot: RobotDescription) -> None:
        self.robot, self.asked = robot, 0
        self.drawn = (float(robot.random.random()), random.random(), float(numpy.random.random()))

    def step(self, observation: Observation) -> Twist:
        self.asked += 1
        return Twist.planar(self.asked, self.drawn[{}])
"""


def of_class(folder: Path, drawn: int, seed: int = 0) -> list[Answer]:
    spec = written(folder, CLASSY.format(drawn))
    controller = spec.open(replace(scene(), workspace=Workspace(folder, folder), seed=seed))
    assert isinstance(controller, ClosedLoop)
    return [controller.command(START) for _ in range(3)]


def test_a_class_is_made_once_and_keeps_what_it_remembers(tmp_path: Path) -> None:
    assert problems(tmp_path, written(tmp_path, CLASSY.format(0))) == []
    assert [answer.linear_xyz[0] for answer in of_class(tmp_path, 0) if isinstance(answer, Twist)] == [1.0, 2.0, 3.0]
    assert ScriptCommands.runs_user_code
    assert not ScriptCommands.needs_drive


@pytest.mark.parametrize("drawn", [0, 1, 2], ids=["robot.random", "random", "numpy.random"])
def test_random_numbers_follow_from_the_seed(drawn: int, tmp_path: Path) -> None:
    first, again, other = (of_class(tmp_path, drawn, seed) for seed in (7, 7, 2**40 + 7))
    assert first == again != other


def test_random_numbers_of_a_function_follow_from_the_seed(tmp_path: Path) -> None:
    text = "import random\nfrom sim_action import Twist\nX = random.random()\n"
    text += "def control(seen): return Twist.planar(X, random.random())\n"
    assert opened(tmp_path, text)(START) == opened(tmp_path, text)(START)


BOTH = "class Controller:\n    def step(self, seen): return None\ndef control(seen): raise KeyError\n"


@pytest.mark.parametrize("text", [BOTH, BOTH + "from neighbour import *\n"])
def test_of_a_class_and_a_function_the_scenario_says_which(text: str, tmp_path: Path) -> None:
    ((path, message),) = problems(tmp_path, written(tmp_path, text))
    assert path == ("script",)
    assert message == (
        "controller.py defines both a class 'Controller' and a function 'control'; "
        "add 'class: Controller' or 'function: control' next to 'script'"
    )


def test_one_key_says_which_of_two_controllers_is_asked(tmp_path: Path) -> None:
    written(tmp_path, BOTH)
    here = replace(scene(), workspace=Workspace(tmp_path, tmp_path))
    by_class = ScriptCommands.model_validate({"script": "controller.py", "class": "Controller"})
    by_function = ScriptCommands(script="controller.py", function="control")
    assert problems(tmp_path, by_class) == problems(tmp_path, by_function) == []
    asked, failing = by_class.open(here), by_function.open(here)
    assert isinstance(asked, ClosedLoop)
    assert isinstance(failing, ClosedLoop)
    assert asked.command(START) is None
    with pytest.raises(ScriptError, match="KeyError"):
        failing.command(START)
    both = ScriptCommands.model_validate({"script": "controller.py", "class": "Controller", "function": "control"})
    assert problems(tmp_path, both) == [
        (("class",), "remove either 'class' or 'function': a script has one controller")
    ]


def with_settings(folder: Path, text: str, **settings: object) -> ScriptCommands:
    (folder / "controller.py").write_text(text, encoding="utf-8")
    return ScriptCommands.model_validate({"script": "controller.py", "with": settings})


INIT = "class Controller:\n    def __init__(self, kp, *, ki=0.0): self.gains = kp, ki\n" + STEP
FUNCTION_OF = "def control(seen, kp, ki=0.0): ...\n"
RECORD = "from dataclasses import dataclass, field\nfrom typing import ClassVar\n@dataclass\nclass Controller:\n"
RECORD += "    kp: float\n    ki: float = 0.0\n    seen: list = field(default_factory=list)\n    N: ClassVar[int] = 3\n"


@pytest.mark.parametrize("text", [INIT, FUNCTION_OF, RECORD + STEP], ids=["class", "function", "dataclass"])
def test_parameters_are_compared_with_the_signature(text: str, tmp_path: Path) -> None:
    assert problems(tmp_path, with_settings(tmp_path, text, kp=1)) == []
    assert problems(tmp_path, with_settings(tmp_path, text, kp=1, ki=2)) == []
    ((path, message),) = problems(tmp_path, with_settings(tmp_path, text, kp=1, kii=2))
    assert path == ("with", "kii")
    assert " has no parameter 'kii'; did you mean 'ki'? (allowed: ki, kp" in message
    assert message.startswith("controller.py:")
    ((path, message),) = problems(tmp_path, with_settings(tmp_path, text, ki=2))
    assert path == ("with",)
    assert " requires 'kp'; add it to 'with'" in message
    ((path, message),) = problems(tmp_path, with_settings(tmp_path, text))
    assert path == ("script",)


@pytest.mark.parametrize(
    "text",
    [
        "class Controller:\n    def __init__(self, **all): ...\n" + STEP,
        "def control(seen, **all): ...",
        "def made(f): return f\n@made\ndef control(seen): ...",
        "def control(seen): ...\ncontrol = print",
        "if True:\n    def control(seen): ...",
        "class Base: ...\nclass Controller(Base):\n" + STEP,
        "def made(f): return f\n@made\nclass Controller:\n" + STEP,
        "from dataclasses import dataclass\n@dataclass(init=False)\nclass Controller:\n    a: int\n" + STEP,
        "class Controller:\n    def __new__(cls, kp): ...\n" + STEP,
        "class Controller:\n    __init__ = print\n" + STEP,
    ],
)
def test_parameters_that_the_text_does_not_show_are_not_refused(text: str, tmp_path: Path) -> None:
    assert problems(tmp_path, with_settings(tmp_path, text, kp=1)) == []


SPEEDY_FUNCTION = "from sim_action import Twist\ndef control(seen, *, speeds=[0], then=None):\n"
SPEEDY_FUNCTION += "    assert type(speeds) is list\n    return Twist.planar(speeds[-1] + (then or {'a': 0})['a'])\n"
SPEEDY_CLASS = "from sim_action import Twist\nclass Controller:\n    def __init__(self, speeds, then):\n"
SPEEDY_CLASS += "        self.x = speeds[-1] + then['a']\n    def step(self, seen): return Twist.planar(self.x)\n"


@pytest.mark.parametrize("text", [SPEEDY_FUNCTION, SPEEDY_CLASS], ids=["function", "class"])
def test_parameters_are_keyword_arguments(text: str, tmp_path: Path) -> None:
    here = replace(scene(), workspace=Workspace(tmp_path, tmp_path))
    controller = with_settings(tmp_path, text, speeds=(1, 2), then={"a": 0.5}).open(here)
    assert isinstance(controller, ClosedLoop)
    assert controller.command(START) == Twist.planar(2.5)


def test_a_parameter_that_only_running_can_refuse_is_a_script_error(tmp_path: Path) -> None:
    here = replace(scene(), workspace=Workspace(tmp_path, tmp_path))
    text = "class Base: ...\nclass Controller(Base):\n" + STEP
    with pytest.raises(ScriptError, match="raised TypeError: "):
        with_settings(tmp_path, text, kp=1).open(here)
