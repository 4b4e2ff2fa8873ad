"""Python files of the user's, as text and as code; what controllers and assertions make of them is tested there."""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_action.core.errors import ScriptError
from sim_action.core.user_scripts import ScriptProblem, SharedModules, read_script, run_file, script_error


def names(folder: Path, text: str) -> set[str]:
    (folder / "a.py").write_text(text, encoding="utf-8")
    return set(read_script(folder / "a.py").names)


def test_names_are_those_outside_of_functions_and_classes(tmp_path: Path) -> None:
    text = "import os\nfrom x import y as z\nclass A:\n    b = 1\ndef c():\n    d = 2\nif A:\n    e = 3\n"
    assert names(tmp_path, text) == {"os", "z", "A", "c", "e"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("def f(:\n", "^:1: not valid Python"),
        ("x = 1\0", "not valid Python"),
        ("#" * 1_000_001, "larger than 1000 kB"),
        ("(" * 5000, "not valid Python"),
    ],
)
def test_what_is_no_python(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ScriptProblem, match=message):
        names(tmp_path, text)


@pytest.mark.skipif(sys.platform == "win32", reason="there are no such files")
def test_what_is_no_file_holds_nobody_up(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.py")
    with pytest.raises(OSError, match="it is not a regular file"):
        read_script(tmp_path / "a.py")


@pytest.mark.usefixtures("modules")
def test_running_gives_what_is_left_and_errors_their_line(tmp_path: Path) -> None:
    file = tmp_path / "a.py"
    file.write_text("x = 1\n")
    assert run_file(file, "it")["x"] == 1
    file.write_text("x = 1\nraise ValueError('no')\n")
    with pytest.raises(ScriptError, match="it raised ValueError: no") as raised:
        run_file(file, "it")
    assert raised.value.location is not None
    assert raised.value.location.line == 2


def ran(file: Path, text: str) -> Mapping[str, Any]:
    file.write_text(text)
    return run_file(file, "it")


@pytest.fixture
def modules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Those of a test are gone after it, as is what it can import."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield
    for name, module in list(sys.modules.items()):
        if str(getattr(module, "__file__", None)).startswith(str(tmp_path)):
            del sys.modules[name]


DATACLASS = """\
from __future__ import annotations
from dataclasses import dataclass

def made():
    @dataclass
    class Point:
        x: int
    return Point(1)

class State:
    def __init__(self):
        self.seen = 3
"""


@pytest.mark.usefixtures("modules")
def test_each_run_of_a_file_is_a_module_as_python_knows_them(tmp_path: Path) -> None:
    found = ran(tmp_path / "my_state.py", DATACLASS)
    assert found["made"]().x == 1
    assert pickle.loads(pickle.dumps(found["State"]())).seen == 3
    assert found["__name__"] == "my_state"
    assert list(tmp_path.iterdir()) == [tmp_path / "my_state.py"]
    first, second = (ran(tmp_path / "my_state.py", f"{DATACLASS}x = [{n}]\n") for n in (1, 2))
    assert (first["x"], second["x"]) == ([1], [2])
    assert first["State"] is not second["State"]
    assert pickle.loads(pickle.dumps(second["State"]())).seen == 3


@pytest.mark.usefixtures("modules")
@pytest.mark.parametrize("name", ["json.py", "colorsys.py", "numpy.py", "my.json.py", "my-json.py"])
def test_a_file_replaces_no_module(name: str, tmp_path: Path) -> None:
    before = dict(sys.modules)
    found = ran(tmp_path / name, DATACLASS)
    assert pickle.loads(pickle.dumps(found["State"]())).seen == 3
    assert {key: sys.modules[key] for key in before} == before
    assert "colorsys" not in sys.modules or "colorsys" in before


@pytest.mark.usefixtures("modules")
def test_how_files_fail(tmp_path: Path) -> None:
    with pytest.raises(ScriptError):
        ran(tmp_path / "my_state.py", "1 / 0\n")
    assert "my_state" not in sys.modules
    text = "def even(n): return odd(n + 1)\ndef odd(n): return even(n + 1)\neven(0)\n"
    with pytest.raises(ScriptError, match="RecursionError") as raised:
        ran(tmp_path / "a.py", text)
    assert raised.value.details.count("File ") == 10
    with pytest.raises(ScriptError, match="No module named 'rclpy'; scripts run in sim-action's own Python"):
        ran(tmp_path / "a.py", "import rclpy\n")


@pytest.mark.usefixtures("modules")
def test_the_way_to_an_error_is_kept_without_our_own_frames(tmp_path: Path) -> None:
    (tmp_path / "beside.py").write_text("def divide(x):\n    return 1 / x\n")
    with pytest.raises(ScriptError) as raised:
        ran(tmp_path / "a.py", "import beside\n\ndef control():\n    beside.divide(0)\n\ncontrol()\n")
    assert raised.value.location is not None
    assert (raised.value.location.file, raised.value.location.line) == (str(tmp_path / "a.py"), 4)
    way, _, source = raised.value.details.partition("\n\n")
    assert source == "a.py:4\n  2 |\n  3 | def control():\n> 4 |     beside.divide(0)\n  5 |\n  6 | control()"
    lines = [line.strip() for line in way.splitlines() if line.strip(" ~^")]
    assert lines == [
        "Traceback (most recent call last):",
        'File "a.py", line 6, in <module>',
        "control()",
        'File "a.py", line 4, in control',
        "beside.divide(0)",
        'File "beside.py", line 2, in divide',
        "return 1 / x",
    ]


@pytest.mark.usefixtures("modules")
@pytest.mark.parametrize(
    ("text", "details"),
    [
        ("1 / 0\n", "a.py:1\n> 1 | 1 / 0"),
        ("x = 1\ndef f(:\n", "a.py:2\n  1 | x = 1\n> 2 | def f(:"),
        ("x = 1\n\n\n\n1 / 0\n\n\n\n\n\ny = 1", "a.py:5\n  3 |\n  4 |\n> 5 | 1 / 0\n  6 |\n  7 |"),
        ("raise MemoryError\n", ""),
    ],
)
def test_an_error_at_one_place_has_no_other_way(text: str, details: str, tmp_path: Path) -> None:
    with pytest.raises(ScriptError) as raised:
        ran(tmp_path / "a.py", text)
    assert raised.value.details == details


def test_a_text_is_parsed_once_whoever_asks(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text("def control(observation): ...\n")
    (tmp_path / "b.py").write_bytes((tmp_path / "a.py").read_bytes())
    first = read_script(tmp_path / "a.py")
    assert read_script(tmp_path / "b.py") is first
    (tmp_path / "a.py").write_text("def other(observation): ...\n")
    assert read_script(tmp_path / "a.py").names == {"other"}
    error = script_error(ValueError("no"), tmp_path / "a.py", "it")
    assert error.location is not None
    assert error.location.line is None


def test_deep_code_shows_no_parameters(tmp_path: Path) -> None:
    """The parser accepts chains of some thousand names; each part of one is a node inside the next."""
    chain = "a" + ".b" * 2500
    texts = {
        "class A:\n    x: int\n    y: 'ClassVar[int]' = 2": ("x",),
        "class A:\n    x: int\n    y: typing.ClassVar[int] = 2": ("x",),
        f"class A:\n    x: {'-' * 900}1 = 1": ("x",),
        f"class A:\n    x: {chain} = 1": ("x",),
    }
    for text, names in texts.items():
        (tmp_path / "a.py").write_text(f"@dataclasses.dataclass\n{text}\n")
        found = read_script(tmp_path / "a.py").class_named("A")
        assert found is not None
        assert found.parameters is not None
        assert found.parameters.names == names
    for decorator in (chain, f"{chain}()", "made()()"):
        (tmp_path / "a.py").write_text(f"@{decorator}\nclass A:\n    x: int\n")
        found = read_script(tmp_path / "a.py").class_named("A")
        assert found is not None
        assert found.parameters is None


@pytest.mark.parametrize(
    ("module", "name", "value"),
    [("json", "dumps", None), ("numpy", "asarray", max), ("numpy.linalg", "norm", None), ("os", "getlogin", len)],
)
def test_replaced_functions_are_the_fault(module: str, name: str, value: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    shared = SharedModules()
    monkeypatch.setattr(sys.modules[module], "an_addition", max, raising=False)
    assert shared.fault(TypeError("x")) is None
    monkeypatch.setattr(sys.modules[module], name, value)
    fault = shared.fault(TypeError("x"))
    assert isinstance(fault, ScriptError)
    assert f"replaced {module}.{name}, which sim-action uses" in str(fault)
    assert "(TypeError: x)" in str(fault)
    monkeypatch.delattr(sys.modules[module], name)
    assert shared.replaced() == [f"{module}.{name}"]


def test_a_module_that_is_gone_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    shared = SharedModules()
    assert np.__name__ in sys.modules
    monkeypatch.setitem(sys.modules, "numpy", None)  # as code may do
    assert shared.replaced() == ["numpy"]
