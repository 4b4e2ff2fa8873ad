"""ONNX networks: their inputs and outputs, read from the file, and a session of onnxruntime that runs them.

The file is read here, as protocol buffers, so that sizes are checked without onnxruntime, and no other file is opened:
weights in files of their own are refused. Only the process of the scenario imports onnxruntime.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from sim_action.core.files import read_at_most
from sim_action.core.records import dataclass, replace
from sim_action.core.wording import escaped_line

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

PACKAGE: Final = "onnxruntime"
INSTALL_HINT: Final = (
    "policies need the package onnxruntime, which is not installed: pip install 'sim-action[policy]', or in a workflow "
    "set the input 'extras: policy'"
)
MAX_NETWORK_BYTES: Final = 100_000_000
MAX_FIELDS: Final = 500_000
"""The greatest number of fields of a file, such as names of nodes; each array of weights is one."""

# In onnx.proto: TensorProto.DataType and the numbers of fields.
_FLOATS: Final = {1: "float32", 11: "float64"}
_TYPES: Final = {**_FLOATS, 6: "int32", 7: "int64", 9: "bool", 10: "float16", 16: "bfloat16"}
_EXTERNAL: Final = 1
_MAX_NESTING: Final = 16
MAX_DIMENSIONS: Final = 16
MAX_TENSORS: Final = 1000
"""The greatest number of inputs, and of outputs."""

_MAX_MESSAGE_CHARS: Final = 300
_MAX_VARINT_BYTES: Final = 10
_MAX_FIELD_NUMBER: Final = (1 << 29) - 1
_ENUM_MASK: Final = 0xFFFF_FFFF


class NetworkProblem(ValueError):
    """The reason why a file cannot be used as a network; it follows the name of the file in messages."""


@dataclass(frozen=True, slots=True)
class Tensor:
    """An input or output of a network.

    Attributes:
        type: the type of its numbers, such as "float32".
        shape: its dimensions; None is one that the caller chooses.
    """

    name: str
    type: str
    shape: tuple[int | None, ...]

    @property
    def size(self) -> int | None:
        """The number of values of one sample; None if a dimension other than that of the samples is free."""
        inner = self.shape[1:] if len(self.shape) > 1 else self.shape
        return None if None in inner else math.prod(size or 1 for size in self.shape)

    def shape_for(self, size: int) -> tuple[int, ...]:
        """Return the shape of one sample with `size` values."""
        if self.size is None or self.size != size:
            return (*([1] * (len(self.shape) - 1)), size)
        return tuple(1 if each is None else each for each in self.shape)

    def __str__(self) -> str:
        return " x ".join("any" if each is None else str(each) for each in self.shape) or "a single number"


@dataclass(frozen=True, slots=True)
class Network:
    """The inputs and outputs of a network by name, and the content of its file."""

    inputs: Mapping[str, Tensor]
    outputs: Mapping[str, Tensor]
    content: bytes


def read_network(path: Path) -> Network:
    """Read a file without running it. Raise OSError, NetworkProblem."""
    if (content := read_at_most(path, MAX_NETWORK_BYTES)) is None:
        raise NetworkProblem(f"is larger than {MAX_NETWORK_BYTES // 1_000_000} MB, the maximum")
    try:
        return _network(content)
    except _Malformed:
        raise NetworkProblem("is not an ONNX file") from None


def network_signature(path: Path) -> Network:
    """Return the inputs and outputs of a file, without its content. Raise OSError, NetworkProblem.

    The file is read again only if it has changed.
    """
    status = path.stat()
    found = _signature(path, status.st_mtime_ns, status.st_size)
    if isinstance(found, str):
        raise NetworkProblem(found)
    return found


@lru_cache(maxsize=64)
def _signature(path: Path, changed_ns: int, size: int) -> Network | str:  # noqa: ARG001 - they name the version
    try:
        return replace(read_network(path), content=b"")
    except NetworkProblem as error:
        return str(error)


class _Malformed(Exception):
    """Bytes that are not a message."""


_Value = int | memoryview


def _network(content: bytes) -> Network:
    _check(memoryview(content), _MODEL, 0, iter(range(MAX_FIELDS)))
    graphs = [value for number, value in _fields(memoryview(content)) if number == 7]
    if len(graphs) != 1:
        raise _Malformed
    graph = _part(graphs[0])
    weights = {_text(value, 8) for number, value in _fields(graph) if number == 5}
    inputs, outputs = (
        [_tensor(_part(value)) for number, value in _fields(graph) if number == which] for which in (11, 12)
    )
    if not outputs:
        raise _Malformed
    # Older files also list all weights as inputs.
    needed = {each.name: each for each in inputs if each.name not in weights}
    given = {each.name: each for each in outputs}
    for found, what in ((needed, "inputs"), (given, "outputs")):
        if len(found) > MAX_TENSORS:
            raise NetworkProblem(f"has {len(found):,} {what}; at most {MAX_TENSORS:,} are read")
    return Network(needed, given, content)


_MODEL, _GRAPH, _NODE, _ATTRIBUTE, _TENSOR, _SPARSE, _FUNCTION, _VALUE, _TYPE, _TENSOR_TYPE, _SHAPE, _SIZE = range(12)
_PARTS: Final[Mapping[int, Mapping[int, int]]] = {
    _MODEL: {7: _GRAPH, 25: _FUNCTION},
    _FUNCTION: {7: _NODE, 11: _ATTRIBUTE},
    _GRAPH: {1: _NODE, 5: _TENSOR, 11: _VALUE, 12: _VALUE, 15: _SPARSE},
    _NODE: {5: _ATTRIBUTE},
    _ATTRIBUTE: {5: _TENSOR, 6: _GRAPH, 10: _TENSOR, 11: _GRAPH, 22: _SPARSE, 23: _SPARSE},
    _SPARSE: {1: _TENSOR, 2: _TENSOR},
    _VALUE: {2: _TYPE},
    _TYPE: {1: _TENSOR_TYPE},
    _TENSOR_TYPE: {2: _SHAPE},
    _SHAPE: {1: _SIZE},
}
"""Kind of message -> field -> kind of the message in it, for all that can hold a tensor, and all that is read here."""


def _check(message: memoryview, kind: int, depth: int, budget: Iterator[int]) -> None:
    """Raise NetworkProblem for a tensor whose values are in another file, and for too many fields.

    :param budget: has one item for each field that may still be read.
    """
    if depth > _MAX_NESTING:
        raise NetworkProblem("has too many graphs inside each other")
    parts, is_external = _PARTS.get(kind, {}), False
    for number, value in _fields(message):
        if next(budget, None) is None:
            raise NetworkProblem(f"has more than {MAX_FIELDS:,} fields, the maximum")
        if kind == _TENSOR:
            # An enum has 32 bits.
            is_external |= number == 13 or (number == 14 and _number(value) & _ENUM_MASK == _EXTERNAL)
        elif number in parts:
            _check(_part(value), parts[number], depth + 1, budget)
    if is_external:
        raise NetworkProblem(
            f"has weights in another file (tensor '{escaped_line(_text(message, 8))}'); save it with all weights "
            "inside: onnx.save(model, path, save_as_external_data=False)"
        )


def _tensor(message: memoryview) -> Tensor:
    name, of_type = _text(message, 1), _last(message, 2)
    tensor = None if of_type is None else _last(of_type, 1)
    if tensor is None:
        raise NetworkProblem(f"has '{escaped_line(name)}', which is not a tensor")
    number = next((value for key, value in _fields(tensor) if key == 1), 0)
    shape = _last(tensor, 2)
    dimensions = [] if shape is None else [_part(value) for key, value in _fields(shape) if key == 1]
    if len(dimensions) > MAX_DIMENSIONS:
        count = f"{len(dimensions):,} dimensions; at most {MAX_DIMENSIONS} are read"
        raise NetworkProblem(f"has '{escaped_line(name[:_MAX_MESSAGE_CHARS])}' with {count}")
    return Tensor(name, _TYPES.get(_number(number), "another type"), tuple(map(_dimension, dimensions)))


def _dimension(message: memoryview) -> int | None:
    found = [_number(value) for key, value in _fields(message) if key == 1]
    return found[-1] if found and 0 < found[-1] <= MAX_NETWORK_BYTES else None


def _last(message: memoryview, wanted: int) -> memoryview | None:
    found = [_part(value) for key, value in _fields(message) if key == wanted]
    return found[-1] if found else None


def _text(message: _Value, wanted: int) -> str:
    found = _last(_part(message), wanted)
    return "" if found is None else bytes(found).decode("utf-8", errors="replace")


def _part(value: _Value) -> memoryview:
    if isinstance(value, int):
        raise _Malformed
    return value


def _number(value: _Value) -> int:
    if not isinstance(value, int):
        raise _Malformed
    return value


def _fields(message: memoryview) -> Iterator[tuple[int, _Value]]:
    """Yield each field of a message with its number. Raise _Malformed."""
    at, end = 0, len(message)
    while at < end:
        key, at = _varint(message, at)
        number, wire = key >> 3, key & 7
        if number > _MAX_FIELD_NUMBER:
            raise _Malformed
        if wire == 0:
            value, at = _varint(message, at)
            yield number, value
            continue
        if wire == 2:
            size, at = _varint(message, at)
        else:
            size = {1: 8, 5: 4}.get(wire, end)
        if number == 0 or size > end - at:
            raise _Malformed
        yield number, message[at : at + size]
        at += size


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    value = 0
    for place in range(_MAX_VARINT_BYTES):
        if at + place >= len(message):
            raise _Malformed
        byte = message[at + place]
        value |= (byte & 0x7F) << (7 * place)
        if byte < 0x80:
            return value, at + place + 1
    raise _Malformed


class Session:
    """A network that is ready to run: on the processor, in one thread, and silent."""

    def __init__(self, network: Network) -> None:
        """Load the network. Raise ImportError without onnxruntime, NetworkProblem."""
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
        # Optimizations beyond these choose operators by the kind of processor.
        options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_BASIC
        options.use_deterministic_compute = True
        options.enable_cpu_mem_arena = False
        options.log_severity_level = 4
        try:
            self._session = onnxruntime.InferenceSession(network.content, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # noqa: BLE001 - its errors have no common class
            raise NetworkProblem(_reason(error)) from None

    def run(self, values: Mapping[str, NDArray[Any]], outputs: Sequence[str]) -> list[NDArray[np.float64]]:
        """Return outputs by name as float64. Raise NetworkProblem."""
        import numpy as np

        try:
            found = self._session.run(list(outputs), dict(values))
        except Exception as error:  # noqa: BLE001 - its errors have no common class
            raise NetworkProblem(_reason(error)) from None
        return [np.asarray(each, dtype=np.float64) for each in found]


def _reason(error: Exception) -> str:
    text = " ".join(str(error).split())
    return f"onnxruntime refuses it: {escaped_line(text[:_MAX_MESSAGE_CHARS])}"


def float_problem(tensor: Tensor, what: str) -> str | None:
    """Return the problem of an input or output that is not of floats; else None."""
    if tensor.type in _FLOATS.values():
        return None
    return f"{what} '{escaped_line(tensor.name)}' is of {tensor.type}; policies have float32 or float64"
