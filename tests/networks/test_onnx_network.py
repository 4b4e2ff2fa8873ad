"""ONNX files in onnxruntime: shapes that fit, weights in other files, and files that are refused before a run."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.workspace import PathError, Workspace
from sim_action.networks import onnx_network
from sim_action.networks.network_check import checked_network
from sim_action.networks.onnx_network import Feed, NetworkProblem, Session, Tensor
from tests.onnx_files import (
    BOOL,
    DOUBLE,
    INT32,
    INT64,
    TEXT,
    external,
    linear,
    model,
    node,
    number,
    part,
    recurrent,
    tensor,
)
from tests.soak import examples

GOOD = linear([[1, 2], [3, 4], [5, 6]], [0.5, 0])


def session(folder: Path, content: bytes) -> Session:
    (folder / "a.onnx").write_bytes(content)
    return Session(Workspace(folder, folder), "a.onnx")


def refusal(folder: Path, content: bytes, feeds: dict[str, Feed] | None = None) -> str:
    """Return the problem that the process of the check reports."""
    (folder / "a.onnx").write_bytes(content)
    with pytest.raises(NetworkProblem) as raised:
        checked_network(Workspace(folder, folder), "a.onnx", feeds or {})
    return str(raised.value)


@pytest.mark.parametrize(
    ("shape", "size", "frames", "filled"),
    [
        ((1, 3), 3, 1, (1, 3)),
        ((None, 3), 3, 1, (1, 3)),
        ((None, 3), 6, 2, None),
        ((3,), 3, 1, (3,)),
        ((1, 2, 3), 6, 2, (1, 2, 3)),
        ((None,), 7, 1, (7,)),
        ((1, None), 7, 1, (1, 7)),
        ((None, None), 7, 1, (1, 7)),
        ((1, None, 4), 20, 5, (1, 5, 4)),
        ((None, None, 4), 20, 5, (1, 5, 4)),
        ((None, None, None), 20, 5, (1, 5, 4)),
        ((None, 4, None), 20, 5, (1, 4, 5)),
        ((64, 3), 3, 1, (64, 3)),
        ((64, None), 3, 1, (64, 3)),
        ((64, 3), 4, 1, None),
        ((1, 3), 4, 1, None),
    ],
)
def test_values_get_the_shape_of_one_sample(
    shape: tuple[int | None, ...], size: int, frames: int, filled: tuple[int, ...] | None
) -> None:
    shapes = Tensor("x", "float32", shape).shapes(Feed(size, frames))
    assert shapes == ([] if filled is None else [filled])


@given(st.lists(st.none() | st.integers(1, 6), min_size=1, max_size=4), st.integers(1, 60), st.integers(1, 5))
@examples(200)
def test_a_shape_holds_the_values_and_keeps_what_is_declared(shape: list[int | None], size: int, frames: int) -> None:
    for filled in Tensor("x", "float32", tuple(shape)).shapes(Feed(size, frames)):
        assert all(stated in (None, each) for stated, each in zip(shape, filled, strict=True))
        assert np.prod(filled) in (size, size * filled[0])


def test_an_input_without_a_shape_is_tried_in_several(tmp_path: Path) -> None:
    live = session(tmp_path, model([node("MatMul", ["x", "w"], ["y"])], {"x": None}, {"y": None}, [W]))
    assert live.fit({"x": Feed(2)}).results == {"y": 2}
    assert live.shapes == {"x": (1, 2)}
    # A single number has none either.
    live = session(tmp_path, model([node("Range", ["z", "x", "o"], ["y"])], {"x": None}, {"y": None}, ZERO_AND_ONE))
    assert live.fit({"x": Feed(value=3.0)}).results == {"y": 3}


W = tensor("w", (2, 2), [1, 0, 0, 1])
ZERO_AND_ONE = [tensor("z", (), [0]), tensor("o", (), [1])]


def test_a_session_computes_what_the_file_says(tmp_path: Path) -> None:
    live = session(tmp_path, linear([[1, 2], [3, 4], [5, 6]], [0.5, 0], DOUBLE))
    (result,) = live.run({"obs": np.array([[1.0, 2.0, 3.0]])}, ["actions"])
    assert result.tolist() == [[22.5, 28.0]]
    assert live.network.inputs == {"obs": Tensor("obs", "float64", (1, 3))}


@pytest.mark.parametrize(
    ("kind", "value", "problem"),
    [
        (BOOL, False, None),
        (BOOL, 1, None),
        (INT32, 1, None),
        (INT64, (1, 2), None),
        (DOUBLE, 1, None),
        (TEXT, "walk", None),
        (BOOL, 2, "has the input 'c' of bool, which cannot be 2"),
        (INT32, 0.5, "has the input 'c' of int32, which cannot be 0.5"),
        (INT32, "a", "has the input 'c' of int32, which cannot be 'a'"),
        (INT32, 1 << 40, "has the input 'c' of int32, which cannot be 1099511627776"),
    ],
)
def test_a_constant_has_the_type_of_its_input(kind: int, value: Any, problem: str | None, tmp_path: Path) -> None:
    nodes = [node("Identity", ["x"], ["y"]), node("Identity", ["c"], ["d"])]
    shapes: dict[str, Any] = {"x": (1, 2), "c": (2 if isinstance(value, tuple) else "batch",)}
    content = model(nodes, shapes, {"y": (1, 2), "d": ("batch",)}, kinds={"c": kind, "d": kind})
    live = session(tmp_path, content)
    feeds = {"x": Feed(2), "c": Feed(value=value)}
    if problem is not None:
        with pytest.raises(NetworkProblem) as raised:
            live.fit(feeds)
        assert str(raised.value) == problem
        return
    live.fit(feeds)
    (passed,) = live.run({"x": np.zeros((1, 2), np.float32), "c": live.constant("c", value)}, ["d"])
    assert passed.tolist() == (list(value) if isinstance(value, tuple) else [value])


def test_random_numbers_of_a_network_are_the_same_in_each_session(tmp_path: Path) -> None:
    attribute = part(5, part(1, "shape") + number(8, 3) + number(20, 7))
    content = model([node("RandomNormal", [], ["y"], attribute)], {}, {"y": (3,)})
    first, second = ([session(tmp_path, content).run({}, ["y"])[0].tolist()] for _ in range(2))
    assert first == second != [[0, 0, 0]]


def externally(location: str) -> bytes:
    return model([node("MatMul", ["x", "w"], ["y"])], {"x": (1, 2)}, {"y": (1, 2)}, [external("w", (2, 2), location)])


@pytest.mark.parametrize("name", ["a.onnx.data", "weights/" + "w" * 150])
def test_weights_may_be_in_a_file_beside_it(name: str, tmp_path: Path) -> None:
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_bytes(np.array([[1, 2], [3, 4]], np.float32).tobytes())
    live = session(tmp_path, externally(name))
    assert live.run({"x": np.ones((1, 2), np.float32)}, ["y"])[0].tolist() == [[4, 6]]


@pytest.mark.parametrize(
    ("location", "problem"),
    [
        ("a.onnx.data", "has weights in another file, but 'a.onnx.data' does not exist (looked for "),
        ("../secret", "has weights in another file, but '../secret' is outside the workspace "),
        ("link", "has weights in another file, but 'link' is outside the workspace "),
        (".git/config", "has weights in another file, but '.git/config' is in the folder .git of "),
        ("/etc/passwd", "has weights in another file, but '/etc/passwd' is outside the workspace "),
        ("short", "is refused by onnxruntime: "),
    ],
)
def test_weights_in_other_files_pass_the_check_of_the_workspace(location: str, problem: str, tmp_path: Path) -> None:
    folder = tmp_path / "inside"
    (folder / ".git").mkdir(parents=True)
    for path in (tmp_path / "secret", folder / ".git/config"):
        path.write_bytes(bytes(16))
    (folder / "link").symlink_to(tmp_path / "secret")
    (folder / "short").write_bytes(bytes(3))
    with pytest.raises(NetworkProblem) as raised:
        session(folder, externally(location))
    assert str(raised.value).startswith(problem)


def hidden(where: str) -> bytes:
    """A network with weights in another file, which are not found by their first bytes."""
    fields = number(1, 2) + number(2, 1) + part(8, "w") + number(14, 1)
    weights = fields + part(13, part(2, "../secret") + part(1, "location"))
    if where == "weights":
        return model([node("Add", ["x", "w"], ["y"])], {"x": (2,)}, {"y": (2,)}, [weights])
    attribute = part(5, part(1, "value") + part(5, weights) + number(20, 4))
    return model([node("Constant", [], ["w"], attribute), node("Add", ["x", "w"], ["y"])], {"x": (2,)}, {"y": (2,)})


@pytest.mark.parametrize("where", ["weights", "constant"])
def test_onnxruntime_opens_no_file_by_itself(where: str, tmp_path: Path) -> None:
    folder = tmp_path / "inside"
    folder.mkdir()
    (tmp_path / "secret").write_bytes(np.ones(2, np.float32).tobytes())
    with pytest.raises(NetworkProblem, match=r"^is refused by onnxruntime: "):
        session(folder, hidden(where))


def test_all_files_together_have_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "w").write_bytes(bytes(16))
    monkeypatch.setattr(onnx_network, "MAX_NETWORK_BYTES", len(externally("w")) + 15)
    with pytest.raises(NetworkProblem, match="has more than 0 MB with its weights, the maximum"):
        session(tmp_path, externally("w"))


def test_the_number_of_files_with_weights_has_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "w").write_bytes(bytes(16))
    monkeypatch.setattr(onnx_network, "_MAX_DATA_FILES", 1)
    session(tmp_path, externally("w"))
    weights = [external(name, (2, 2), name) for name in "wv"]
    with pytest.raises(NetworkProblem, match="has weights in 2 files; at most 1 are read"):
        session(tmp_path, model([node("MatMul", ["w", "v"], ["y"])], {}, {"y": (2, 2)}, weights))


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"hello world",
        GOOD[:-20],
        b"PK\x03\x04" + bytes(100),
        model([node("NoSuchOperator", ["x"], ["y"])], {"x": (2,)}, {"y": (2,)}),
        model([node("Add", ["x", "absent"], ["y"])], {"x": (2,)}, {"y": (2,)}),
    ],
)
def test_what_is_no_network_is_a_problem_in_one_line(
    content: bytes, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(NetworkProblem, match=r"^is refused by onnxruntime: ") as raised:
        session(tmp_path, content)
    assert "\n" not in str(raised.value)
    assert str(tmp_path) not in str(raised.value)
    assert capfd.readouterr() == ("", "")


@given(st.data())
@examples(40)
def test_changed_bytes_are_opened_or_refused(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    content = bytearray(GOOD)
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    folder = tmp_path_factory.mktemp("network")
    with suppress(NetworkProblem, PathError):
        session(folder, bytes(content[: data.draw(st.integers(0, len(content)))])).fit({})


def function(name: str, calls: list[str]) -> bytes:
    """Return a function of a file that calls others, one after the other."""
    names = ["a", *(f"v{place}" for place in range(len(calls) - 1)), "b"]
    domain = part(7, "l")
    nodes = [
        part(7, node(call, [before], [after]) + (domain if call != "Identity" else b""))
        for call, before, after in zip(calls, names, names[1:], strict=False)
    ]
    versions = part(9, number(2, 17)) + part(9, part(1, "l") + number(2, 1))
    return part(25, part(1, name) + part(4, "a") + part(5, "b") + b"".join(nodes) + versions + part(10, "l"))


def calling(name: str, functions: list[bytes]) -> bytes:
    rest = part(8, part(1, "l") + number(2, 1)) + b"".join(functions)
    return model([node(name, ["x"], ["y"]) + part(7, "l")], {"x": (2,)}, {"y": (2,)}, rest=rest)


def billions() -> bytes:
    sizes = tensor("s", (2,), [70_000, 70_000], INT64)
    nodes = [node("ConstantOfShape", ["s"], ["c"]), node("ReduceSum", ["c"], ["r"]), node("Add", ["x", "r"], ["y"])]
    return model(nodes, {"x": (1, 1)}, {"y": (1, 1)}, [sizes])


def fields() -> bytes:
    return number(1, 8) + part(7, part(1, b"") * 20_000_000)


def recursion() -> bytes:
    return calling("F", [function("F", ["G"]), function("G", ["F"])])


def many_calls() -> bytes:
    return calling("F24", [function("F0", ["Identity"]), *(function(f"F{i}", [f"F{i - 1}"] * 2) for i in range(1, 25))])


MEMORY = "needs more memory than a network of its size may use"
# The check of `a.onnx`, and then the most memory of its process in kB. A process that is started counts the peak of the
# process that starts it, too, so a small one does.
CHECKS = """
import resource, sys
from pathlib import Path
from sim_action.core.workspace import Workspace
from sim_action.networks.network_check import checked_network
from sim_action.networks.onnx_network import Feed, NetworkProblem
try:
    checked_network(Workspace(Path.cwd(), Path.cwd()), "a.onnx", {"x": Feed(int(sys.argv[1]))})
except NetworkProblem as problem:
    print(problem)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""


@pytest.mark.process
@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited on Linux")
@pytest.mark.parametrize(
    ("content", "size", "problem"),
    [
        (billions, 1, MEMORY),
        (fields, 2, MEMORY),
        (recursion, 2, "is refused by onnxruntime: "),
        (many_calls, 2, "takes onnxruntime more processor time than 1.0 s to be opened, or 10 s to run once"),
    ],
)
def test_a_hostile_file_ends_within_its_limits(
    content: Callable[[], bytes], size: int, problem: str, tmp_path: Path
) -> None:
    (tmp_path / "a.onnx").write_bytes(content())
    command = [sys.executable, "-c", CHECKS, str(size)]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    *message, peak_kb = ran.stdout.splitlines()
    assert "\n".join(message).startswith(problem)
    assert int(peak_kb) <= 200_000


@pytest.mark.process
def test_the_check_opens_a_file_again_only_if_it_has_changed(tmp_path: Path) -> None:
    (tmp_path / "a.onnx").write_bytes(GOOD)
    workspace = Workspace(tmp_path, tmp_path)
    network = checked_network(workspace, "a.onnx", {})
    assert network.results == {"actions": 2}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(subprocess, "run", pytest.fail)
        assert checked_network(workspace, "a.onnx", {}) == network
    (tmp_path / "a.onnx").write_bytes(recurrent())
    assert list(checked_network(workspace, "a.onnx", {}).inputs) == ["obs", "h_in"]
