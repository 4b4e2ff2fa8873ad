"""ONNX files as bytes: what is read of them, and which of them are refused before anything runs."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.commands import onnx_network
from sim_action.commands.onnx_network import (
    MAX_FIELDS,
    MAX_NETWORK_BYTES,
    Network,
    NetworkProblem,
    Session,
    Tensor,
    network_signature,
    read_network,
)
from tests.onnx_files import DOUBLE, INT64, linear, model, node, number, part, recurrent, tensor, value_info, varint
from tests.soak import examples

GOOD = linear([[1, 2], [3, 4], [5, 6]], [0.5, 0])


def refusal(folder: Path, content: bytes) -> str:
    (folder / "a.onnx").write_bytes(content)
    with pytest.raises(NetworkProblem) as raised:
        read_network(folder / "a.onnx")
    return str(raised.value)


def test_inputs_and_outputs_have_names_types_and_shapes(tmp_path: Path) -> None:
    (tmp_path / "a.onnx").write_bytes(GOOD)
    network = read_network(tmp_path / "a.onnx")
    assert network.inputs == {"obs": Tensor("obs", "float32", (1, 3))}
    assert network.outputs == {"actions": Tensor("actions", "float32", (1, 2))}
    (tmp_path / "a.onnx").write_bytes(recurrent())
    assert read_network(tmp_path / "a.onnx").inputs["h_in"] == Tensor("h_in", "float64", (None, 2))


def test_weights_that_are_also_inputs_are_no_inputs(tmp_path: Path) -> None:
    (tmp_path / "a.onnx").write_bytes(
        model([node("Add", ["obs", "w"], ["y"])], {"obs": (2,), "w": (2,)}, {"y": (2,)}, [tensor("w", (2,), [1, 2])])
    )
    assert list(read_network(tmp_path / "a.onnx").inputs) == ["obs"]


@pytest.mark.parametrize(
    ("shape", "size", "filled"),
    [
        ((1, 3), 3, (1, 3)),
        ((None, 3), 3, (1, 3)),
        ((3,), 3, (3,)),
        ((1, 2, 3), 6, (1, 2, 3)),
        ((None,), None, (7,)),
        ((1, None), None, (1, 7)),
        ((1, None, 2), None, (1, 1, 7)),
        ((), 1, ()),
    ],
)
def test_a_free_dimension_is_one_sample(
    shape: tuple[int | None, ...], size: int | None, filled: tuple[int, ...]
) -> None:
    found = Tensor("x", "float32", shape)
    assert found.size == size
    assert found.shape_for(7 if size is None else size) == filled


EXTERNAL = number(1, 2) + number(2, 1) + part(8, "w") + part(13, part(1, "location") + part(2, "../../secret"))
NAMES_ANOTHER_FILE = "has weights in another file (tensor 'w'); save it with all weights inside: onnx.save("


def attribute(field: int, value: bytes) -> bytes:
    return part(5, part(1, "value") + part(field, value))


@pytest.mark.parametrize(
    "content",
    [
        model([], {"x": (2,)}, {"y": (2,)}, [EXTERNAL]),
        model([], {"x": (2,)}, {"y": (2,)}, [number(14, 1) + part(8, "w")]),
        model([node("Constant", [], ["y"], attribute(5, EXTERNAL))], {}, {"y": (2,)}),
        model([node("If", [], ["y"], attribute(6, part(5, EXTERNAL)))], {}, {"y": (2,)}),
        model(
            [node("If", [], ["y"], attribute(6, part(1, node("Constant", [], [], attribute(10, EXTERNAL)))))],
            {},
            {"y": ()},
        ),
        model([node("A", [], ["y"], attribute(22, part(1, EXTERNAL)))], {}, {"y": (2,)}),
        model([], {}, {"y": (2,)}) + part(25, part(7, node("Constant", [], ["y"], attribute(5, EXTERNAL)))),
    ],
    ids=["weights", "location", "constant", "subgraph", "nested", "sparse", "function"],
)
def test_weights_in_another_file_are_refused_wherever_they_are(content: bytes, tmp_path: Path) -> None:
    assert refusal(tmp_path, content).startswith(NAMES_ANOTHER_FILE)


def nested(depth: int) -> bytes:
    inner = part(5, EXTERNAL)
    for _ in range(depth):
        inner = part(1, node("If", [], [], attribute(6, inner)))
    return number(1, 8) + part(7, inner)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is not an ONNX file"),
        (b"hello world, this is text", "is not an ONNX file"),
        (b"\x80" * 30, "is not an ONNX file"),
        (b"PK\x03\x04" + b"\0" * 100, "is not an ONNX file"),
        (GOOD[:-20], "is not an ONNX file"),
        (GOOD + GOOD, "is not an ONNX file"),
        (number(7, 3), "is not an ONNX file"),
        (model([], {"x": (1,)}, {}), "is not an ONNX file"),
        (part(7, part(12, number(1, 3))), "is not an ONNX file"),
        (part(7, part(12, part(1, "y"))), "has 'y', which is not a tensor"),
        (nested(100), "has too many graphs inside each other"),
        (model([], {"x": (9,) * 17}, {"y": (1,)}), "has 'x' with 17 dimensions; at most 16 are read"),
        (model([], {"x": (1,)}, {"y": (99_999_999,) * 3000}), "has 'y' with 3,000 dimensions; at most 16 are read"),
        (model([], {f"x{i}": () for i in range(1001)}, {"y": ()}), "has 1,001 inputs; at most 1,000 are read"),
        (model([], {}, {f"y{i}": () for i in range(1001)}), "has 1,001 outputs; at most 1,000 are read"),
    ],
)
def test_what_is_no_network_is_refused(content: bytes, message: str, tmp_path: Path) -> None:
    assert refusal(tmp_path, content) == message


def test_a_huge_file_is_refused(tmp_path: Path) -> None:
    with (tmp_path / "a.onnx").open("wb") as file:
        file.truncate(MAX_NETWORK_BYTES + 1)
    with pytest.raises(NetworkProblem, match="is larger than 100 MB, the maximum"):
        read_network(tmp_path / "a.onnx")


def test_dimensions_that_no_network_has_are_free(tmp_path: Path) -> None:
    huge = part(1, "y") + part(2, part(1, number(1, 1) + part(2, part(1, number(1, 2**63)))))
    (tmp_path / "a.onnx").write_bytes(part(7, part(12, huge)))
    assert read_network(tmp_path / "a.onnx").outputs["y"].shape == (None,)


@given(st.data())
@examples(60)
def test_changed_bytes_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    content = bytearray(GOOD)
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path_factory.mktemp("network") / "a.onnx"
    path.write_bytes(content[: data.draw(st.integers(0, len(content)))])
    with suppress(NetworkProblem):
        assert read_network(path).outputs


def session(folder: Path, content: bytes) -> Session:
    (folder / "a.onnx").write_bytes(content)
    return Session(read_network(folder / "a.onnx"))


def test_a_session_computes_what_the_file_says(tmp_path: Path) -> None:
    live = session(tmp_path, linear([[1, 2], [3, 4], [5, 6]], [0.5, 0], DOUBLE))
    (found,) = live.run({"obs": np.array([[1.0, 2.0, 3.0]])}, ["actions"])
    assert found.tolist() == [[22.5, 28.0]]


@pytest.mark.parametrize(
    "content",
    [
        model([node("NoSuchOperator", ["x"], ["y"])], {"x": (2,)}, {"y": (2,)}),
        model([node("Add", ["x", "absent"], ["y"])], {"x": (2,)}, {"y": (2,)}),
        model([], {"x": (2,)}, {"y": (2,)}),
        part(7, part(12, value_info("y", (2,)))),
    ],
    ids=["operator", "input", "output", "version"],
)
def test_what_onnxruntime_refuses_is_a_problem_in_one_line(
    content: bytes, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(NetworkProblem, match=r"^onnxruntime refuses it: \[ONNXRuntimeError\]") as raised:
        session(tmp_path, content)
    assert "\n" not in str(raised.value)
    assert capfd.readouterr() == ("", "")


def test_values_that_do_not_fit_are_a_problem(tmp_path: Path) -> None:
    with pytest.raises(NetworkProblem, match="onnxruntime refuses it"):
        session(tmp_path, GOOD).run({"obs": np.zeros((1, 2), np.float32)}, ["actions"])


def test_types_have_names(tmp_path: Path) -> None:
    for kind, name in ((INT64, "int64"), (8, "another type")):
        (tmp_path / "a.onnx").write_bytes(model([], {"x": (2,)}, {"y": (2,)}, kind=kind))
        assert read_network(tmp_path / "a.onnx").inputs["x"].type == name


def test_a_varint_has_at_most_ten_bytes(tmp_path: Path) -> None:
    assert varint(300) == b"\xac\x02"
    assert refusal(tmp_path, b"\xff" * 11) == "is not an ONNX file"


@pytest.mark.parametrize(
    "content",
    [
        GOOD + number(1, 0) * (MAX_FIELDS + 1),
        part(7, number(3, 0) * MAX_FIELDS),
        part(7, part(12, part(2, part(1, part(2, part(1, number(3, 0) * MAX_FIELDS)))))),
    ],
    ids=["model", "graph", "dimension"],
)
def test_a_file_of_many_fields_is_refused_soon(content: bytes, tmp_path: Path) -> None:
    assert refusal(tmp_path, content) == "has more than 500,000 fields, the maximum"


def test_a_file_is_read_again_only_if_it_has_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, reads = tmp_path / "a.onnx", list[Path]()

    def counted(file: Path) -> Network:
        reads.append(file)
        return read_network(file)

    monkeypatch.setattr(onnx_network, "read_network", counted)
    path.write_bytes(GOOD)
    found = [network_signature(path) for _ in range(3)]
    assert (len(reads), found[0].content, list(found[0].inputs)) == (1, b"", ["obs"])
    path.write_bytes(b"x")
    for _ in range(2):
        with pytest.raises(NetworkProblem, match="is not an ONNX file"):
            network_signature(path)
    assert len(reads) == 2


@pytest.mark.parametrize(
    "external",
    [
        varint(((13 << 3) | 2) | 1 << 32) + varint(0),
        varint(14 << 3) + varint((1 << 32) + 1),
    ],
)
def test_numbers_beyond_their_bits_do_not_hide_external_weights(external: bytes, tmp_path: Path) -> None:
    refused = refusal(tmp_path, part(7, part(5, part(8, "w") + external) + part(12, part(1, "y"))))
    assert refused.startswith(("is not an ONNX file", "has weights in another file (tensor 'w')"))
