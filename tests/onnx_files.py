"""ONNX files made of bytes: protocol buffers of a few fields.

The package `onnx` would write them too. It is not used: it takes 30 MB for what are 40 lines here, and it refuses to
write the invalid files that tests need.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Final

import pytest

from sim_action.networks import network_check

FLOAT: Final = 1
DOUBLE: Final = 11
UINT8: Final = 2
INT32: Final = 6
INT64: Final = 7
TEXT: Final = 8
BOOL: Final = 9
HALF: Final = 10
Shape = Sequence[int | str] | None  # Dimensions; a text is the name of a free one. None: the file declares no shape.


def in_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let this process check networks: without limits, and sooner than one of their own."""
    monkeypatch.setattr(network_check, "_allow", lambda *_: None)
    answer = network_check.answer_of
    monkeypatch.setattr(network_check, "_answer", lambda question, _: json.dumps(answer(*json.loads(question))))


_PACKED: Final = {FLOAT: "f", DOUBLE: "d", HALF: "e", INT64: "q", INT32: "i", BOOL: "?"}


def varint(value: int) -> bytes:
    """Return a number as a varint."""
    out = bytearray()
    while value >= 0x80:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes((*out, value))


def number(field: int, value: int) -> bytes:
    """Return a field with a number."""
    return varint(field << 3) + varint(value)


def part(field: int, value: bytes | str) -> bytes:
    """Return a field with a text or a message."""
    data = value.encode() if isinstance(value, str) else value
    return varint(field << 3 | 2) + varint(len(data)) + data


def value_info(name: str, shape: Shape, kind: int = FLOAT) -> bytes:
    """Return an input or output."""
    sizes = [part(1, number(1, each) if isinstance(each, int) else part(2, each)) for each in shape or ()]
    declared = b"" if shape is None else part(2, b"".join(sizes))
    return part(1, name) + part(2, part(1, number(1, kind) + declared))


def external(name: str, shape: Sequence[int], location: str) -> bytes:
    """Return weights of float32 that are in another file."""
    pairs = {"location": location, "offset": "0", "length": str(4 * math.prod(shape))}
    entries = b"".join(part(13, part(1, key) + part(2, value)) for key, value in pairs.items())
    return b"".join(number(1, each) for each in shape) + number(2, FLOAT) + part(8, name) + entries + number(14, 1)


def integer(name: str, value: int) -> bytes:
    """Return an attribute of an operation."""
    return part(5, part(1, name) + number(3, value) + number(20, 2))


def tensor(name: str, shape: Sequence[int], values: Iterable[float], kind: int = FLOAT) -> bytes:
    """Return weights."""
    flat = list(values)
    data = struct.pack(f"<{len(flat)}{_PACKED[kind]}", *flat)
    return b"".join(number(1, each) for each in shape) + number(2, kind) + part(8, name) + part(9, data)


def node(kind: str, inputs: Sequence[str], outputs: Sequence[str], attributes: bytes = b"") -> bytes:
    """Return an operation."""
    return (
        b"".join(part(1, each) for each in inputs)
        + b"".join(part(2, each) for each in outputs)
        + part(4, kind)
        + (attributes)
    )


def subgraph(name: str, nodes: Sequence[bytes], inputs: Mapping[str, int], outputs: Mapping[str, int]) -> bytes:
    """Return an attribute of If, Loop or Scan; `inputs` and `outputs`: name -> kind. Inputs are single numbers."""
    ends = ((field, key, kind) for field, values in ((11, inputs), (12, outputs)) for key, kind in values.items())
    graph = b"".join(part(1, each) for each in nodes) + part(2, name)
    graph += b"".join(part(field, value_info(key, () if field == 11 else None, kind)) for field, key, kind in ends)
    return part(5, part(1, name) + part(6, graph) + number(20, 5))


def model(
    nodes: Sequence[bytes],
    inputs: Mapping[str, Shape],
    outputs: Mapping[str, Shape],
    weights: Sequence[bytes] = (),
    kind: int = FLOAT,
    *,
    kinds: Mapping[str, int] = MappingProxyType({}),
    metadata: Mapping[str, str] = MappingProxyType({}),
    more_outputs: Sequence[bytes] = (),
    rest: bytes = b"",
) -> bytes:
    """Return a whole file; `kinds`: of inputs and outputs that have another one; `rest`: more fields."""
    graph = b"".join(part(1, each) for each in nodes) + part(2, "network") + b"".join(part(5, each) for each in weights)
    graph += b"".join(part(11, value_info(name, shape, kinds.get(name, kind))) for name, shape in inputs.items())
    graph += b"".join(part(12, value_info(name, shape, kinds.get(name, kind))) for name, shape in outputs.items())
    graph += b"".join(part(12, each) for each in more_outputs)
    texts = b"".join(part(14, part(1, key) + part(2, value)) for key, value in metadata.items())
    return number(1, 8) + part(7, graph) + part(8, number(2, 17)) + texts + rest


def linear(weights: Sequence[Sequence[float]], bias: Sequence[float], kind: int = FLOAT) -> bytes:
    """Return a network of one layer: `actions = obs @ weights + bias`; a row of weights for each number of obs."""
    rows, columns = len(weights), len(bias)
    flat = [value for row in weights for value in row]
    layer = [node("MatMul", ["obs", "w"], ["y"]), node("Add", ["y", "b"], ["actions"])]
    stored = [tensor("w", (rows, columns), flat, kind), tensor("b", (columns,), bias, kind)]
    return model(layer, {"obs": (1, rows)}, {"actions": (1, columns)}, stored, kind)


def recurrent() -> bytes:
    """Return a network that adds up its input: `h_out = h_in + obs`, `actions = h_out`."""
    nodes = [node("Add", ["obs", "h_in"], ["h_out"]), node("Identity", ["h_out"], ["actions"])]
    return model(nodes, {"obs": (1, 2), "h_in": ("batch", 2)}, {"actions": (1, 2), "h_out": (1, 2)}, kind=DOUBLE)


def balance() -> bytes:
    """Return examples/commands/balance.onnx: `tanh` of a spring and a damper for each of two joints.

    The observation has two positions in rad, and two velocities in rad/s, scaled by 0.1.
    """
    weights = [-4.0, 0.0, 0.0, -2.0, -1.0, 0.0, 0.0, -0.2]
    nodes = [node("MatMul", ["obs", "weights"], ["sum"]), node("Tanh", ["sum"], ["actions"])]
    return model(nodes, {"obs": (1, 4)}, {"actions": (1, 2)}, [tensor("weights", (4, 2), weights)])
