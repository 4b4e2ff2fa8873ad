"""The actions, substitutions and conditions of `launch` and `launch_ros` that are understood without them.

Launch configurations of an included file stay set after it, as in `launch`.
"""

# ruff: noqa: ARG001, ARG005 - the arguments are the words that a part accepts

from __future__ import annotations

import importlib
import json
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import yaml
from ament_index_python.packages import get_package_prefix, get_package_share_directory, get_packages_with_prefixes

from sim_action.ros.ros2.launch.declared_table import (
    KINDS,
    SUBSTITUTIONS,
    Context,
    LaunchError,
    Part,
    Substitution,
    row,
    unsupported,
)

# Substitutions.


def _substitution(classes: str, text: str, function: Callable[..., str]) -> None:
    row(f"launch.substitutions.{classes}", text=text)(function)


def _truth(value: bool) -> str:
    return "true" if value else "false"


_substitution("TextSubstitution", "", lambda context, text: context.perform_substitution(text))
_substitution("ThisLaunchFile", "filename", lambda context: context.files[-1])
_substitution("ThisLaunchFileDir", "dirname", lambda context: str(Path(context.files[-1]).parent))
_substitution("NotSubstitution", "not", lambda context, value: _truth(not context.is_true(value)))
_substitution("AndSubstitution", "and", lambda context, left, right: _truth(all(map(context.is_true, (left, right)))))
_substitution("OrSubstitution", "or", lambda context, left, right: _truth(any(map(context.is_true, (left, right)))))
_substitution("AnySubstitution", "any", lambda context, *args: _truth(any(map(context.is_true, args))))
_substitution("AllSubstitution", "all", lambda context, *args: _truth(all(map(context.is_true, args))))
_substitution("EqualsSubstitution", "equals", lambda context, left, right: _truth(_is_same(context, left, right)))
_substitution(
    "NotEqualsSubstitution", "not-equals", lambda context, left, right: _truth(not _is_same(context, left, right))
)
_substitution("FileContent", "file-content", lambda context, path: Path(context.perform_substitution(path)).read_text())
# The real name has the host, the process and a random number: no two runs would be equal.
_substitution("AnonName", "anon", lambda context, name: f"{context.perform_substitution(name)}_1")


def _is_same(context: Context, left: Any, right: Any) -> bool:
    one, other = (
        "" if value is None else str(value) if isinstance(value, bool) else context.perform_substitution(value)
        for value in (left, right)
    )
    truths = {"true": True, "1": True, "false": False, "0": False}
    if one.lower() in truths and other.lower() in truths:
        return truths[one.lower()] == truths[other.lower()]
    try:
        return math.isclose(float(one), float(other))
    except ValueError:
        return one == other


@row("launch.substitutions.LaunchConfiguration", text="var")
def _configuration(context: Context, variable_name: Any, default: Any = None) -> str:
    name = context.perform_substitution(variable_name)
    context.used.add(name)
    if name in context.launch_configurations:
        return str(context.launch_configurations[name])
    if default is not None:
        return context.perform_substitution(default)
    raise LaunchError("SubstitutionFailure", f"launch configuration '{name}' does not exist")


@row("launch.substitutions.EnvironmentVariable", text="env")
def _environment(context: Context, name: Any, default_value: Any = None) -> str:
    stated = context.perform_substitution(name)
    if stated in os.environ or default_value is not None:
        return os.environ[stated] if stated in os.environ else context.perform_substitution(default_value)
    raise LaunchError("SubstitutionFailure", f"environment variable '{stated}' does not exist")


@row("launch.substitutions.PathJoinSubstitution|PathSubstitution")
def _joined(context: Context, substitutions: Any) -> str:
    parts = substitutions if isinstance(substitutions, (list, tuple)) else [substitutions]
    return os.path.join(*map(context.perform_substitution, parts))  # noqa: PTH118 - as launch joins them


@row("launch.substitutions.PythonExpression", text="eval")
def _evaluated(context: Context, expression: Any, python_modules: Any = ("math",)) -> str:
    # Launch files are code of the user, as the nodes are that they start.
    listed = python_modules if isinstance(python_modules, (list, tuple)) else [python_modules]
    texts = ",".join(map(context.perform_substitution, listed)).split(",")
    modules = [importlib.import_module(name.strip()) for name in texts]
    names = {name: value for module in modules if module.__name__ == "math" for name, value in vars(module).items()}
    names |= {module.__name__: module for module in modules}
    return str(eval(context.perform_substitution(expression), {}, names))  # noqa: S307 - code of the user


@row("launch.substitutions.Command", text="command")
def _command(context: Context, command: Any, on_stderr: Any = "fail") -> str:
    words = shlex.split(context.perform_substitution(command))
    how = context.perform_substitution(on_stderr)
    joined = subprocess.STDOUT if how == "capture" else subprocess.PIPE
    if shutil.which(words[0]) is None:
        raise LaunchError("SubstitutionFailure", f"the program '{words[0]}' is not on PATH")
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=joined, text=True, check=False)  # noqa: S603 - likewise
    if done.returncode or (done.stderr and how == "fail"):
        said = (done.stderr or done.stdout).strip()[-300:]
        raise LaunchError("SubstitutionFailure", f"'{shlex.join(words)[:200]}' failed: {said}")
    return done.stdout


@row("launch.substitutions.FindExecutable", text="find-exec")
def _executable_path(context: Context, name: Any) -> str:
    program = context.perform_substitution(name)
    path = shutil.which(program)
    if path is None:
        raise LaunchError("SubstitutionFailure", f"the program '{program}' is not on PATH")
    return path


@row("launch.substitutions.IfElseSubstitution", text="if")
def _if_else(context: Context, condition: Any, if_value: Any = "", else_value: Any = "") -> str:
    return context.perform_substitution(if_value if context.is_true(condition) else else_value)


row("launch_ros.substitutions.FindPackageShare", text="find-pkg-share")(
    lambda context, package: get_package_share_directory(context.perform_substitution(package))
)
row("launch_ros.substitutions.FindPackagePrefix|FindPackage", text="find-pkg-prefix")(
    lambda context, package: get_package_prefix(context.perform_substitution(package))
)
row("launch_ros.substitutions.ExecutableInPackage", text="exec-in-pkg")(
    lambda context, executable, package: program_path(*map(context.perform_substitution, (executable, package)))
)


def program_path(program: str, package: str) -> str:
    """Return the path of an executable of a package. Raise LaunchError."""
    prefixes = get_packages_with_prefixes()
    if package not in prefixes:
        raise LaunchError("package", name=package, names=sorted(prefixes))
    folder = Path(prefixes[package], "lib", package)
    if os.access(path := folder / program, os.X_OK) and path.is_file():
        return str(path)
    names = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    raise LaunchError("program", package=package, name=program, names=names)


row(
    "launch.launch_description_sources.AnyLaunchDescriptionSource|FrontendLaunchDescriptionSource",
    "launch.launch_description_sources.PythonLaunchDescriptionSource|LaunchDescriptionSource",
    "launch_xml.launch_description_sources.XMLLaunchDescriptionSource",
    "launch_yaml.launch_description_sources.YAMLLaunchDescriptionSource",
)(lambda context, launch_file_path: context.perform_substitution(launch_file_path))

row("launch.conditions.IfCondition")(lambda context, predicate_expression: context.is_true(predicate_expression))
row("launch.conditions.UnlessCondition")(
    lambda context, predicate_expression: not context.is_true(predicate_expression)
)
row("launch.conditions.LaunchConfigurationEquals")(
    lambda context, launch_configuration_name, expected_value: context.equals(launch_configuration_name, expected_value)
)
row("launch.conditions.LaunchConfigurationNotEquals")(
    lambda context, launch_configuration_name, expected_value: (
        not context.equals(launch_configuration_name, expected_value)
    )
)

# Actions.

row("launch.LaunchDescription", "launch.launch_description.LaunchDescription")(
    lambda context, initial_entities=None, *, deprecated_reason=None: list(initial_entities or ())
)


@row("launch.actions.DeclareLaunchArgument", tag="arg: name default=default_value description choice=choices")
def _argument(
    context: Context, name: Any, *, default_value: Any = None, description: Any = None, choices: Any = None
) -> None:
    stated = context.perform_substitution(name)
    context.declared.add(stated)
    if stated not in context.launch_configurations:
        if default_value is None:
            raise LaunchError("MissingArgument", f"the argument '{stated}' has no value; give {stated}:=VALUE")
        context.launch_configurations[stated] = context.perform_substitution(default_value)
    value = context.launch_configurations[stated]
    if choices and value not in (texts := [context.perform_substitution(choice) for choice in choices]):
        raise LaunchError("InvalidArgument", f"'{stated}' is '{value}', and may be {', '.join(texts)}")


@row("launch.actions.SetLaunchConfiguration", tag="let: name value")
def _set(context: Context, name: Any, value: Any) -> None:
    context.launch_configurations[context.perform_substitution(name)] = context.perform_substitution(value)


row("launch.actions.UnsetLaunchConfiguration")(
    lambda context, name: context.launch_configurations.pop(context.perform_substitution(name), None) and None
)


@row("launch.actions.SetEnvironmentVariable", tag="set_env: name value")
def _set_environment(context: Context, name: Any, value: Any) -> None:
    os.environ[context.perform_substitution(name)] = context.perform_substitution(value)


row("launch.actions.UnsetEnvironmentVariable", tag="unset_env: name")(
    lambda context, name: os.environ.pop(context.perform_substitution(name), None) and None
)


@row("launch.actions.AppendEnvironmentVariable", tag="append_env: name value prepend separator")
def _append_environment(
    context: Context, name: Any, value: Any, prepend: Any = False, separator: Any = os.pathsep
) -> None:
    stated, text = map(context.perform_substitution, (name, value))
    before = [os.environ[stated]] if stated in os.environ else []
    words = [text, *before] if context.is_true(prepend) else [*before, text]
    os.environ[stated] = context.perform_substitution(separator).join(words)


@row("launch.actions.LogInfo|LogWarning|LogError", tag="log: message=msg")
def _log(context: Context, msg: Any) -> None:
    sys.stdout.write(f"[launch.user] {context.perform_substitution(msg)}\n")
    sys.stdout.flush()


@row("launch.actions.GroupAction", tag="group: scoped forwarding keep=launch_configurations actions")
def _group(
    context: Context,
    actions: Any = (),
    *,
    scoped: Any = True,
    forwarding: Any = True,
    launch_configurations: Any = None,
) -> None:
    perform = context.perform_substitution
    kept = {perform(name): perform(value) for name, value in (launch_configurations or {}).items()}
    is_scoped = context.is_true(scoped)
    saved = dict(context.launch_configurations), dict(os.environ)
    if is_scoped and not context.is_true(forwarding):
        context.launch_configurations.clear()
    context.launch_configurations.update(kept)
    context.visit(list(actions))
    if is_scoped:
        for values, before in zip((context.launch_configurations, os.environ), saved, strict=True):
            values.clear()
            values.update(before)


@row("launch.actions.OpaqueFunction")
def _function(context: Context, function: Any, args: Any = None, kwargs: Any = None) -> Any:
    return function(context, *(args or ()), **(kwargs or {}))


@row("launch.actions.IncludeLaunchDescription", tag="include: file=launch_description_source arg=launch_arguments")
def _include(context: Context, launch_description_source: Any, *, launch_arguments: Any = None) -> None:
    for name, value in launch_arguments or ():
        _set(context, name, value)
    file = context.perform_substitution(launch_description_source)
    if not Path(file).is_file():
        raise LaunchError("FileNotFoundError", f"there is no launch file {file}")
    context.files.append(file)
    context.visit(context.read(Path(file)))
    context.files.pop()


@row("launch.actions.Shutdown", "launch.events.Shutdown", tag="shutdown: reason")
def _shutdown(context: Context, reason: Any = "reason not given") -> None:
    context.shutdown = context.perform_substitution(reason)


@row("launch.actions.EmitEvent")
def _emit(context: Context, event: Any) -> None:
    if not (isinstance(event, Part) and event.kind.function is _shutdown):
        name = event.kind.name if isinstance(event, Part) else type(event).__name__
        raise unsupported(f"the event '{name}' of EmitEvent")
    event.run(context)


@row("launch.actions.TimerAction", "launch_ros.actions.ROSTimer", tag="timer ros_timer: period actions")
def _timer(context: Context, period: Any, actions: Any, cancel_on_shutdown: Any = True) -> None:
    context.timers.append((context.now + float(context.perform_substitution(period)), list(actions)))


@row("launch.actions.RegisterEventHandler")
def _register(context: Context, event_handler: Part) -> None:
    if KINDS.get(event_handler.kind.name) is not event_handler.kind:
        raise unsupported(event_handler.kind.name)
    context.handlers.append(event_handler)


row("launch.event_handlers.OnProcessExit")(lambda context, *, target_action=None, on_exit=None: None)
row("launch.event_handlers.OnProcessStart")(lambda context, *, target_action=None, on_start=None: None)
row("launch.event_handlers.OnShutdown")(lambda context, *, on_shutdown=None: None)


@row("launch_ros.actions.PushRosNamespace|PushROSNamespace", tag="push_ros_namespace push-ros-namespace: namespace")
def _push_namespace(context: Context, namespace: Any) -> None:
    configurations = context.launch_configurations
    text = context.perform_substitution(namespace)
    configurations["ros_namespace"] = joined_namespace(configurations.get("ros_namespace"), text)


def joined_namespace(outer: str | None, inner: str | None) -> str | None:
    """Return a namespace inside another one, absolute; None: neither is stated."""
    if inner is None or (outer and not inner.startswith("/")):
        inner = outer if inner is None else f"{(outer or '').rstrip('/')}/{inner}"
    return None if inner is None else f"/{inner.strip('/')}"


@row("launch_ros.actions.SetParameter", tag="set_parameter: name value")
def _set_parameter(context: Context, name: Any, value: Any) -> None:
    ((word, plain),) = parameters(context, {tuple(name) if isinstance(name, list) else name: value}).items()
    text = plain if isinstance(plain, str) else json.dumps(plain)
    _extend(context, "global_params", ("-p", f"{word}:={text}"))


@row("launch_ros.actions.SetParametersFromFile", tag="set_parameters_from_file: filename")
def _set_parameters(context: Context, filename: Any) -> None:
    _extend(context, "global_params", ("--params-file", context.perform_substitution(filename)))


@row("launch_ros.actions.SetRemap", tag="set_remap: from=src to=dst")
def _set_remap(context: Context, src: Any, dst: Any) -> None:
    _extend(context, "ros_remaps", ("-r", ":=".join(map(context.perform_substitution, (src, dst)))))


# All nodes use sim time.
row("launch_ros.actions.SetUseSimTime", tag="set_use_sim_time: value")(lambda context, value: None)


def _extend(context: Context, key: str, words: tuple[str, str]) -> None:
    context.launch_configurations[key] = [*context.launch_configurations.get(key, ()), words]


@row(
    "launch.actions.ExecuteProcess|ExecuteLocal",
    tag="executable: cmd name cwd launch-prefix=prefix env=additional_env on_exit shell respawn output emulate_tty "
    "respawn_delay respawn_max_retries sigterm_timeout sigkill_timeout",
)
def _process(
    context: Context,
    *,
    cmd: Any,
    name: Any = None,
    prefix: Any = None,
    cwd: Any = None,
    env: Any = None,
    additional_env: Any = None,
    shell: Any = False,
    respawn: Any = False,
    on_exit: Any = None,
) -> dict[str, Any]:
    """Return the process: its words, whether a shell runs it, its environment, folder, label and what follows it."""
    perform = context.perform_substitution
    prefix = context.launch_configurations.get("launch-prefix") if prefix is None else prefix
    more = {**dict(env or {}), **dict(additional_env or {})}
    return {
        "prefix": shlex.split(perform(prefix)),
        "words": [word for word in map(perform, cmd) if word.strip()],
        "label": perform(name),
        "cwd": perform(cwd) or None,
        "env": {**({} if env is not None else os.environ), **{perform(key): perform(more[key]) for key in more}},
        "shell": context.is_true(shell),
        "respawn": context.is_true(respawn),
        "on_exit": on_exit,
        "node": "",
        "ros_words": None,
        "package": "",
    }


@row(
    "launch_ros.actions.Node",
    tag="node: pkg=package exec=executable name namespace exec_name args=arguments ros_args=ros_arguments cwd "
    "launch-prefix=prefix env=additional_env on_exit shell respawn output emulate_tty respawn_delay "
    "respawn_max_retries sigterm_timeout sigkill_timeout remap=remappings param=parameters",
)
def _node(
    context: Context,
    *,
    executable: Any,
    package: Any = None,
    name: Any = None,
    namespace: Any = None,
    exec_name: Any = None,
    parameters: Any = None,
    remappings: Any = None,
    ros_arguments: Any = None,
    arguments: Any = None,
    **process: Any,
) -> dict[str, Any]:
    """Return the process of a node: its program is PACKAGE/PROGRAM, and `ros_words` are for ROS."""
    unknown = process.keys() - KINDS["launch.actions.ExecuteProcess"].signature.parameters.keys() - {"cmd"}
    if unknown:
        raise unsupported(f"'{min(unknown)}' of Node")
    perform = context.perform_substitution
    owner = perform(package)
    facts = _process(context, cmd=[executable, *(arguments or ())], name=exec_name, **process)
    inner = None if namespace is None else perform(namespace)
    space = joined_namespace(context.launch_configurations.get("ros_namespace"), inner)
    stated = perform(name)
    full_name = f"{space.rstrip('/')}/{stated}" if space is not None and stated else ""
    words = list(map(perform, ros_arguments or ()))
    words += ["-r", f"__node:={stated}"] if stated else []
    words += ["-r", f"__ns:={space}"] if space is not None else []
    for pair in context.launch_configurations.get("global_params", ()):
        words += pair
    for values in parameters or ():
        words += _parameter_words(context, values, full_name or "/**")
    for pair in context.launch_configurations.get("ros_remaps", ()):
        words += pair
    for one, other in remappings or ():
        words += ["-r", f"{perform(one)}:={perform(other)}"]
    return {**facts, "ros_words": words, "package": owner, "node": full_name}


def _parameter_words(context: Context, values: Any, node: str) -> list[str]:
    if isinstance(values, Part) and values.kind.function is _typed_parameter:
        words = values.words_of(context).arguments
        pair = parameters(context, {words["name"]: KINDS[_VALUE](words["value"], words.get("value_type"))})
        return [word for name in pair for word in ("-p", f"{name}:={json.dumps(pair[name])}")]
    if isinstance(values, Mapping):
        content = {node: {"ros__parameters": parameters(context, values)}}
        return ["--params-file", context.perform_substitution(KINDS[_FILE](json.dumps(content), allow_substs=None))]
    path = context.perform_substitution(values)
    if not Path(path).is_file():
        _log(context, f"Parameter file path is not a file: {path}")  # as launch does it, which goes on
        return []
    return ["--params-file", path]


_VALUE = "launch_ros.parameter_descriptions.ParameterValue"
_FILE = "launch_ros.parameter_descriptions.ParameterFile"


@row(_VALUE, "launch_ros.descriptions.ParameterValue")
def _parameter_value(context: Context, value: Any, value_type: Any = None) -> Any:
    """Return a value of a type; without one, the type that YAML gives to its text."""
    if isinstance(value, (bool, int, float)) or (isinstance(value, str) and value_type in (None, str)):
        return value
    is_text = isinstance(value, (str, Substitution)) or any(isinstance(part, Substitution) for part in value)
    if not is_text:
        inner = (getattr(value_type, "__args__", None) or [None])[0]
        return [_parameter_value(context, part, inner) for part in value]
    text = context.perform_substitution(value)
    if value_type in (int, float, str):
        return value_type(text)
    text = {"1": "true", "0": "false"}.get(text, text) if value_type is bool else text
    loaded = yaml.safe_load(text) if text else text
    if value_type is bool and not isinstance(loaded, bool):
        raise LaunchError("ValueError", f"'{text}' is neither true nor false")
    return loaded


@row("launch_ros.parameter_descriptions.Parameter", "launch_ros.descriptions.Parameter")
def _typed_parameter(context: Context, name: Any, value: Any, *, value_type: Any = None) -> None:
    """Hold a parameter, which its node takes."""


@row(_FILE, "launch_ros.descriptions.ParameterFile")
def _parameter_file(context: Context, param_file: Any, *, allow_substs: Any = False) -> str:
    """Return the path of a file; with substitutions, or as a content (`allow_substs` None), of a written one."""
    text = context.perform_substitution(param_file)
    if allow_substs is not None:
        if not context.is_true(allow_substs):
            return text
        text = context.perform_substitution(parsed(Path(text).read_text(encoding="utf-8")))
    path = context.folder / f"launch-{len(list(context.folder.glob('launch-*.yaml')))}.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def parameters(context: Context, values: Mapping[Any, Any], before: str = "") -> dict[str, Any]:
    """Return the names and values of parameters; nested names are joined by points. Raise LaunchError."""
    flat: dict[str, Any] = {}
    for key, value in values.items():
        name = before + context.perform_substitution(key)
        if isinstance(value, Mapping):
            flat |= parameters(context, value, f"{name}.")
        else:
            flat[name] = _plain(context, name, value)
    return flat


def _plain(context: Context, name: str, value: Any) -> Any:
    """Return the value of a parameter by the rules of launch_ros: all but plain text is read as YAML."""
    if isinstance(value, Part) and value.kind.function is _parameter_value:
        return value.run(context)
    if isinstance(value, (str, bool, int, float)):
        return value
    is_list = isinstance(value, (list, tuple)) and not (
        any(isinstance(part, Substitution) for part in value)
        and all(isinstance(part, (str, Substitution)) for part in value)
    )
    if is_list:
        loaded = [part if isinstance(part, (str, bool, int, float)) else _loaded(context, part) for part in value]
        loaded = [float(part) for part in loaded] if {type(part) for part in loaded} == {int, float} else loaded
    else:
        loaded = _loaded(context, value)
    kinds = {type(part) for part in loaded} if isinstance(loaded, list) else {type(loaded)}
    if len(kinds) != 1 or not kinds <= {str, bool, int, float}:
        hint = "; if it is a text, use ParameterValue(..., value_type=str)"
        raise LaunchError("TypeError", f"the parameter '{name}' has no type of ROS: {str(loaded)[:60]}{hint}")
    return loaded


def _loaded(context: Context, value: Any) -> Any:
    text = context.perform_substitution(value)
    try:
        return yaml.safe_load(text) if text else text
    except yaml.YAMLError as error:
        raise LaunchError("TypeError", f"'{text[:60]}' is not YAML: {str(error).splitlines()[0]}") from None


_OPENING = re.compile(r"(?<!\\)\$\(")


def parsed(text: str) -> list[Any]:
    """Return the texts and substitutions of a text of XML or YAML. Raise LaunchError."""
    parts: list[Any] = []
    start = 0
    while match := _OPENING.search(text, start):
        end = _end(text, match.end())
        if end < 0:
            raise LaunchError("InvalidSubstitution", f"'{text}' has a '$(' without ')'")
        name, *words = _words(text[match.end() : end]) or [""]
        if name not in SUBSTITUTIONS:
            raise unsupported(f"the substitution '$({name})'")
        parts += [_unescaped(text[start : match.start()]), SUBSTITUTIONS[name].part(tuple(map(parsed, words)))]
        start = end + 1
    return [part for part in (*parts, _unescaped(text[start:])) if part != ""]


def _unescaped(text: str) -> str:
    return re.sub(r"\\(.)", r"\1", text)


def _end(text: str, start: int) -> int:
    """Return the place of the ')' that closes the '(' before the start, -1 if there is none."""
    depth, place = 0, start
    while place < len(text):
        depth += (text[place] == "(") - (text[place] == ")")
        if depth < 0:
            return place
        place += 2 if text[place] == "\\" else 1
    return -1


def _words(text: str) -> list[str]:
    """Return the words of a substitution without outer quotes; quoted blanks and those in parentheses are in words."""
    words = list[str]()
    word, quote, depth, is_open = "", "", 0, False
    signs = iter(text)
    for sign in signs:
        depth += (sign == "(") - (sign == ")") if not quote else 0
        if sign == "\\":
            word, is_open = word + sign + next(signs, ""), True
        elif not depth and sign in "'\"" and quote in ("", sign):
            quote, is_open = ("" if quote else sign), True
        elif sign.isspace() and not quote and not depth:
            words, word, is_open = words + [word] * is_open, "", False
        else:
            word, is_open = word + sign, True
    return words + [word] * is_open


def split(parts: list[Any]) -> list[list[Any]]:
    """Return the words of a command line: only texts are split at blanks, not what substitutions give."""
    words: list[list[Any]] = [[]]
    for part in parts:
        tokens = shlex.split(part) if isinstance(part, str) else [part]
        if isinstance(part, str) and part[:1].isspace():
            words.append([])
        for place, token in enumerate(tokens):
            words += [[]] * bool(place)
            words[-1] = [*words[-1], token]
        if isinstance(part, str) and part[-1:].isspace():
            words.append([])
    return [word for word in words if word]
