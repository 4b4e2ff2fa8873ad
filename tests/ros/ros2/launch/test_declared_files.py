"""Launch files without `launch`: what each form of a part starts, and what is refused, with its file and line.

The same cases were compared with the real `launch` and `launch_ros` outside the repository.
"""

from __future__ import annotations

import json
import subprocess
from typing import Any, Final

import pytest

from tests.patience import PATIENCE
from tests.ros.ros2.nodes import ROOT, missing_launch, missing_ros, variables

pytestmark = pytest.mark.process

PROBE: Final = """\
import json, os, sys
from pathlib import Path
from types import ModuleType

sys.modules["sim_action"] = ModuleType("sim_action")
sys.modules["sim_action"].__path__ = [sys.argv[1]]
from sim_action.ros.ros2.launch.declared_files import install_modules, read_file
from sim_action.ros.ros2.launch.declared_table import KINDS, Context, LaunchError

install_modules()
results = {}
for file in sorted(Path(sys.argv[2]).glob("*")):
    started = []
    files = Path(sys.argv[3], file.name)
    files.mkdir()

    def start(action, process):
        words = [*process["prefix"], *process["words"]]
        ros = process["ros_words"] or []
        plain = [word for word in ros if word not in ("-r", "--params-file")]
        words += [Path(word).read_text() if word.startswith(str(files)) else word for word in plain]
        started.append(words)

    context = Context(start, read_file, files)
    environment = dict(os.environ)
    try:
        context.visit(KINDS["launch.actions.IncludeLaunchDescription"].part((str(file),)))
        while context.timers:
            context.visit(context.timers.pop(0)[1])
        results[file.name] = {"started": started, "shutdown": context.shutdown}
    except Exception as error:
        refusal = LaunchError.of(error)
        lines = [line for path, line in refusal.places if path == str(file)]
        results[file.name] = {"refused": refusal.event, "line": lines[-1] if lines else 0, "started": started}
    os.environ.clear()
    os.environ.update(environment)
print(json.dumps(results))
"""

PYTHON: Final = """\
import launch
from launch import LaunchDescription
from launch.actions import *
from launch.conditions import *
from launch.event_handlers import *
from launch.substitutions import *
from launch_ros.actions import *
from launch_ros.actions import LifecycleNode
from launch_ros.parameter_descriptions import ParameterValue

def generate_launch_description():
    return LaunchDescription([{}])
"""
LINE: Final = 12


def parameters(node: str = "/**", /, **values: object) -> str:
    return json.dumps({node: {"ros__parameters": {name.replace("__", "."): value for name, value in values.items()}}})


STARTED: Final[dict[str, tuple[str, list[list[str]]]]] = {
    "words.launch.xml": (
        """<launch><arg name="a" default="x y"/>
        <node pkg="p" exec="e" name="n" namespace="s"
         args="1  $(var a)-b 'c d'"><remap from="one" to="$(var a)"/></node>
        </launch>""",
        [["e", "1", "x y-b", "c d", "__node:=n", "__ns:=/s", "one:=x y"]],
    ),
    "values.launch.xml": (
        """<launch><node pkg="p" exec="e">
        <param name="a" value="1"/><param name="b" value="1" type="str"/><param name="c" value="1,2" value-sep=","/>
        <param name="d"><param name="e" value="true"/></param></node></launch>""",
        [["e", parameters(a=1), parameters(b="1"), parameters(c=[1, 2]), parameters(d__e=True)]],
    ),
    "values.launch.yaml": (
        "launch:\n- node:\n    pkg: p\n    exec: e\n    param: [{name: a, value: '1'}, {name: b, value: 0.5}]\n",
        [["e", parameters(a="1"), parameters(b=0.5)]],
    ),
    "empty.launch.py": (
        PYTHON.format(
            "DeclareLaunchArgument('a', default_value=''), "
            "Node(package='p', executable='e', arguments=[LaunchConfiguration('a', default='x'), 'b'])"
        ),
        [["e", "b"]],
    ),
    "values.launch.py": (
        PYTHON.format(
            "Node(package='p', executable='e', name='n', namespace='s', parameters=[{'a': '1', 'b': [1, 2.5], "
            "'c': [TextSubstitution(text='[1, '), '2]'], 'd': {'e': TextSubstitution(text='true')}, "
            "'f': ParameterValue(TextSubstitution(text='1'), value_type=str)}])"
        ),
        [[*("e", "__node:=n", "__ns:=/s"), parameters("/s/n", a="1", b=[1.0, 2.5], c=[1, 2], d__e=True, f="1")]],
    ),
    "scopes.launch.xml": (
        """<launch><group>
        <push_ros_namespace namespace="a"/><set_parameter name="p" value="1"/><let name="x" value="1"/>
        <group><push-ros-namespace namespace="b"/><node pkg="p" exec="e"/></group><node pkg="p" exec="f"/></group>
        <node pkg="p" exec="g" args="$(var x out)"/></launch>""",
        [["e", "__ns:=/a/b", "-p", "p:=1"], ["f", "__ns:=/a", "-p", "p:=1"], ["g", "out"]],
    ),
    "substitutions.launch.xml": (
        '<launch><let name="m" value="sim"/><executable cmd="$(eval \'1 + len(&quot;$(var m)&quot;)\') '
        "$(env NO_SUCH $(var m)) $(not true) $(equals 1 1.0) $(if $(eval '\\'$(var m)\\' == \\'sim\\'') yes no) "
        '\\$(x) $(anon a)"/></launch>'.replace("\\$(x)", "end"),
        [["4", "sim", "false", "true", "yes", "end", "a_1"]],
    ),
    # Parts that only launch has may stand where nothing runs.
    "unused.launch.xml": (
        """<launch><group if="false"><node_container pkg="p" exec="e"/><node pkgs="p"/></group>
        <node pkg="p" exec="e"/><nonsense unless="1"/></launch>""",
        [["e"]],
    ),
    "unused.launch.py": (
        PYTHON.format(
            "GroupAction([LifecycleNode(nonsense=1)], condition=IfCondition('0')), Node(package='p', executable='e', "
            "output='screen', emulate_tty=True), Node(wrong=1, condition=UnlessCondition('true'))"
        ),
        [["e"]],
    ),
    "deep.launch.py": (
        "from launch.launch_context import LaunchContext\nfrom launch.substitutions.text_substitution import "
        "TextSubstitution as Text\n"
        + PYTHON.format(
            "Node(package='p', executable=PathJoinSubstitution(['a', Text(text='b')]).perform(LaunchContext()))"
        ),
        [["a/b"]],
    ),
    "later.launch.py": (
        PYTHON.format(
            "TimerAction(period=1.0, actions=[Node(package='p', executable='e')]), OpaqueFunction(function=lambda "
            "context: [ExecuteProcess(cmd=[LaunchConfiguration('x', default='d').perform(context), ['a', 'b']])])"
        ),
        [["d", "ab"], ["e"]],
    ),
}
"""Name of a file -> its text, and the commands that it starts."""

INSIDE: Final = '<launch><node pkg="p" exec="e">\n{}</node></launch>'
IN_PYTHON: Final = {
    "word.launch.py": ("Node(package='p', executable='e', paramters=[])", "'paramters' of Node"),
    "container.launch.py": ("ComposableNodeContainer(name='c')", "'ComposableNodeContainer' of launch_ros.actions"),
    "class.launch.py": ("launch.actions.OpaqueCoroutine()", "'OpaqueCoroutine' of launch.actions"),
    "event.launch.py": ("RegisterEventHandler(OnProcessIO(on_stdout=print))", "'OnProcessIO' of launch.event_handlers"),
    "mixed.launch.py": (
        "Node(package='p', executable='e', parameters=[{'a': [1, 'b']}])",
        "the parameter 'a' has no type of ROS",
    ),
    "object.launch.py": ("object()", "an action of the class 'object'"),
    "missing.launch.py": ("DeclareLaunchArgument('a')", "the argument 'a' has no value"),
    "choice.launch.py": (
        "DeclareLaunchArgument('a', default_value='x', choices=['y', 'z'])",
        "'a' is 'x', and may be y, z",
    ),
}
"""Name of a file -> its actions, and a part of the message."""
REFUSED: Final[dict[str, tuple[str, str, int]]] = {
    "tag.launch.xml": ("<launch>\n<node_container/>\n</launch>", "the element <node_container>", 2),
    "attribute.launch.xml": ('<launch>\n\n<node pkg="p" exec="e" respwan="1"/></launch>', "'respwan' of <node>", 3),
    "word.launch.xml": ('<launch>\n<node package="p" exec="e"/></launch>', "'package' of <node>", 2),
    "inner.launch.xml": (INSIDE.format('<remap from="a" to="b" c="d"/>'), "'c' of <remap>", 1),
    "child.launch.xml": ('<launch>\n<let name="a" value="b"><x/></let></launch>', "<x> in <let>", 2),
    "root.launch.xml": ("<launch unknown='1'/>", "'unknown' of <launch>", 0),
    "text.launch.xml": ('<launch>\n<log message="$(param x)"/></launch>', "the substitution '$(param)'", 2),
    "open.launch.xml": ('<launch>\n<log message="$(var x"/></launch>', "has a '$(' without ')'", 2),
    "name.launch.xml": ('<launch>\n<log message="$(var x)"/></launch>', "launch configuration 'x' does not exist", 2),
    "broken.launch.xml": ("<launch>\n<node></launch>", "it is not XML: mismatched tag", 2),
    "type.launch.xml": (INSIDE.format('<param name="a" value="1" type="double"/>'), "the type 'double' of <param>", 1),
    "key.launch.yaml": ("launch:\n- node: {pkg: p, exec: e}\n- let:\n    nam: a\n", "'nam' of <let>", 3),
    "tag.launch.yaml": ("launch:\n- node: {pkg: p, exec: e}\n- leet: {name: a}\n", "the element <leet>", 3),
    "broken.launch.yaml": ("launch:\n- node: {pkg: p\n", "it is not YAML", 3),
    "root.launch.yaml": ("lunch: []\n", "its root must be 'launch'", 1),
    "syntax.launch.py": ("x = 1\nx = (\n", "'(' was never closed", 2),
    "function.launch.py": ("x = 1\n", "has no function generate_launch_description", 0),
    **{name: (PYTHON.format(text), message, LINE) for name, (text, message) in IN_PYTHON.items()},
}
"""Name of a file -> its text, a part of the message, and the line (0: none in the file)."""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What became of all files, which one process of ROS's Python reads."""
    if missing := missing_ros():
        pytest.skip(missing)
    if not missing_launch():
        pytest.skip("launch is installed")
    folder = tmp_path_factory.mktemp("launch")
    for name in ("files", "written"):
        (folder / name).mkdir()
    for name, text in {name: case[0] for cases in (STARTED, REFUSED) for name, case in cases.items()}.items():
        (folder / "files" / name).write_text(str(text))
    python = variables()["SIM_ACTION_ROS2_PYTHON"]
    done = subprocess.run(
        [python, "-c", PROBE, str(ROOT / "sim_action"), str(folder / "files"), str(folder / "written")],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    read: dict[str, Any] = json.loads(done.stdout)
    return read


@pytest.mark.parametrize("name", STARTED)
def test_a_launch_file_starts_what_launch_would(name: str, results: dict[str, Any]) -> None:
    assert results[name] == {"started": STARTED[name][1], "shutdown": None}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_known_is_refused_by_its_name_and_line(name: str, results: dict[str, Any]) -> None:
    _, message, line = REFUSED[name]
    assert message in results[name].get("refused", {}).get("message", ""), results[name]
    assert results[name]["line"] == line
