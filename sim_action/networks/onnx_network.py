"""ONNX networks in onnxruntime: their inputs and outputs, and sessions that run them.

onnxruntime opens the network alone. Weights in other files are read here, each after the check of the workspace.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path, PurePath
from typing import Any, Final

from sim_action.core.files import open_regular
from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.records import dataclass, field, replace
from sim_action.core.wording import escaped_line, shown
from sim_action.core.workspace import PathError, Workspace

PACKAGE: Final = "onnxruntime"
INSTALL_HINT: Final = (
    "policies need the package onnxruntime, which is not installed: pip install 'sim-action[policy]', or in a workflow "
    "set the input 'extras: policy'"
)
MAX_NETWORK_BYTES: Final = 1_000_000_000  # the greatest size of a network with all its files
_TYPE_NAMES: Final = {"float": "float32", "double": "float64", "string": "object"}
FLOATS: Final = frozenset({"float16", "float32", "float64"})
_WHOLE: Final = frozenset({"bool", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))})
NUMERIC: Final = FLOATS | _WHOLE
"""Types of inputs and outputs that policies can have; a constant may also be of "object", which is text."""

# A field of a tensor whose values are in another file: its key "location", and the name of that file.
_LOCATION: Final = re.compile(rb"\x0a\x08location\x12([\x80-\xff]?)([\x00-\x7f])")
_PATH: Final = re.compile(r"Load model from .*? failed: ?")  # the path of the network is no part of a message
# Operations whose result is finite although an input is NaN.
_HIDING: Final = frozenset(
    {
        *(b"ArgMax", b"ArgMin", b"Hardmax", b"MaxPool", b"ReduceMax", b"ReduceMin", b"ThresholdedRelu", b"TopK"),
        *(b"Greater", b"GreaterOrEqual", b"Less", b"LessOrEqual"),
    }
)
# Numbers of fields in ONNX files.
_GRAPH, _GRAPH_NODE, _GRAPH_TENSOR, _GRAPH_INPUT, _GRAPH_OUTPUT = 7, 1, 5, 11, 12
_NODE_INPUT, _NODE_OUTPUT, _NODE_OPERATION, _NODE_ATTRIBUTE = 1, 2, 4, 5
_FUNCTION, _FUNCTION_NODE, _ATTRIBUTE_GRAPH, _TENSOR_NAME = 25, 7, 6, 8
TOO_MUCH_MEMORY: Final = "needs more memory than a network of its size may use"
_MAX_DATA_FILES: Final = 1000
_MAX_FIELDS: Final = 100_000
_MAX_MESSAGE_CHARS: Final = 300


class NetworkProblem(ValueError):
    """The reason why a file cannot be used as a network; it follows the name of the file in messages."""


@dataclass(frozen=True, slots=True)
class Feed:
    """The values that an input is given: a constant, values of a known shape, or a number of values."""

    size: int | None = None  # the number of values; None if it is not known
    frames: int = 1  # the number of observations among them
    shape: tuple[int, ...] | None = None  # of a picture
    value: Any = None  # of a constant


@dataclass(frozen=True, slots=True)
class Tensor:
    """An input or output of a network."""

    name: str
    type: str  # the type of its numbers, such as "float32"
    # its dimensions as the file declares them; None is one that the caller chooses. Empty: a single number, or no
    # declared shape.
    shape: tuple[int | None, ...]

    def shapes(self, feed: Feed) -> list[tuple[int, ...]]:
        """Return the shapes in which it may be given the values of a feed; none if no shape fits, or none is known."""
        minimal_shape = tuple(dimension or 1 for dimension in self.shape)
        if feed.shape is not None:
            return [feed.shape]
        if feed.value is not None and not isinstance(feed.value, tuple):
            return [minimal_shape] if self.shape else [(), (1,), (1, 1)]
        size = len(feed.value) if feed.value is not None else feed.size
        if size is None:
            return [minimal_shape] if self.shape and None not in self.shape[1:] else []
        if not self.shape:
            return [(1, size), (size,), *([()] if size == 1 else [])]
        filled = _filled(self.shape, size, feed.frames)
        return [] if filled is None else [filled]

    def __str__(self) -> str:
        return " x ".join("any" if dimension is None else str(dimension) for dimension in self.shape) or "any shape"


def _filled(shape: tuple[int | None, ...], size: int, frames: int) -> tuple[int, ...] | None:
    """Return the shape of one sample of `size` values; a first dimension from the training repeats the sample."""
    filled = [dimension or 1 for dimension in shape]
    rest, remainder = divmod(size, math.prod(filled))
    # The first of several free dimensions counts the samples.
    free = [index for index, dimension in enumerate(shape) if dimension is None and (index or len(shape) == 1)]
    if remainder == 0 and (rest == 1 or free):
        if len(free) > 1 and rest % frames == 0:
            filled[free[0]], rest = frames, rest // frames
        for index in free[-1:]:
            filled[index] *= rest
        return tuple(filled)
    row = _filled((1, *shape[1:]), size, frames) if len(shape) > 1 and filled[0] > 1 else None
    return None if row is None else (filled[0], *row[1:])


@dataclass(frozen=True, slots=True)
class Network:
    """The inputs and outputs of a network by name."""

    inputs: Mapping[str, Tensor]
    outputs: Mapping[str, Tensor]
    metadata: Mapping[str, str] = field(default_factory=dict)  # the texts that its exporter added
    # name of an output -> number of values that a run returned for one sample; None if it was not run
    results: Mapping[str, int] | None = None


def is_installed() -> bool:
    """Return True if onnxruntime is installed; it is not imported."""
    return find_spec(PACKAGE) is not None


class Session:
    """A network that is ready to run: on the processor, in one thread, and silent."""

    def __init__(self, workspace: Workspace, file: str, limit: Callable[[int], None] = lambda _: None) -> None:
        """Open a network. Raise ImportError without onnxruntime, NetworkProblem, PathError, OSError.

        :param limit: is called with a size in bytes before as many are loaded.
        """
        import onnxruntime

        path = workspace.file(file)
        content = _content(path, 0, limit)
        # onnxruntime may read these weights until it is closed.
        self._data = _data_files(content, Path(file).parent, workspace, limit)
        self.size = len(content) + sum(map(len, self._data.values()))
        selections = _selections(content)
        # The operations that hide a NaN of a value inside a subgraph or function, which cannot be an output.
        self.blind = sorted(selections.blind)
        if added := selections.watched - selections.outputs:
            limit(2 * self.size)
            # Parts of a message are merged: these become more outputs of the same graph.
            content += _field(
                _GRAPH, b"".join(_field(_GRAPH_OUTPUT, _field(1, name.encode())) for name in sorted(added))
            )
        source = content if added else str(path)
        del content
        # A network that draws random numbers draws the same in each run.
        onnxruntime.set_seed(0)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
        # Optimizations beyond these choose operators by the kind of processor.
        options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_BASIC
        options.use_deterministic_compute = True
        options.enable_cpu_mem_arena = False
        options.log_severity_level = 4
        # With a table of files, even one without any of them, onnxruntime opens none by itself.
        data = self._data or {"": b"\0"}
        options.add_external_initializers_from_files_in_memory([*data], [*data.values()], [*map(len, data.values())])
        try:
            self._session = onnxruntime.InferenceSession(source, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # noqa: BLE001 - its errors have no common class
            raise NetworkProblem(_reason(error)) from None
        results = {argument.name: _tensor(argument) for argument in self._session.get_outputs()}
        # The inner values that can be NaN while every output is finite, such as the input of ArgMax.
        self.hidden = [name for name, tensor in results.items() if name in selections.watched and tensor.type in FLOATS]
        self.network = Network(
            {argument.name: _tensor(argument) for argument in self._session.get_inputs()},
            {name: tensor for name, tensor in results.items() if name not in added},
            dict(self._session.get_modelmeta().custom_metadata_map),
        )
        self.shapes: Mapping[str, tuple[int, ...]] = {}  # name of an input -> the shape of its values, after `fit`
        self.batch = 1  # equal samples in a run: more than 1 if the file declares the number of the training

    def fit(self, feeds: Mapping[str, Feed]) -> Network:
        """Run it once with zeros, and constants, in shapes that fit its inputs. Raise NetworkProblem.

        It is not run if the shape of an input is not known.
        """
        inputs = self.network.inputs
        input_feeds = {name: feeds.get(name, Feed()) for name in inputs}
        choices = {name: tensor.shapes(input_feeds[name]) for name, tensor in inputs.items()}
        names = [name for name, tensor in self.network.outputs.items() if tensor.type in NUMERIC]
        if (
            not names
            or not all(choices.values())
            or any(tensor.type not in {*NUMERIC, "object"} for tensor in inputs.values())
        ):
            return self.network
        problem = None
        for place in range(max(map(len, choices.values()), default=1)):
            self.shapes = {name: shapes[min(place, len(shapes) - 1)] for name, shapes in choices.items()}
            try:
                zeros = {name: self.constant(name, feed.value or 0) for name, feed in input_feeds.items()}
                results = self.run(zeros, names)
            except NetworkProblem as error:
                problem = problem or error
                continue
            values = {name: math.prod(self.shapes[name]) for name in inputs}
            self.batch = max((values[name] // feed.size for name, feed in input_feeds.items() if feed.size), default=1)
            rows = [self.batch if output.shape[:1] == (self.batch,) else 1 for output in results]
            sizes = {name: output.size // count for name, output, count in zip(names, results, rows, strict=True)}
            return replace(self.network, results=sizes)
        raise problem or NetworkProblem("has no outputs")

    def constant(self, name: str, value: Any) -> NDArray[Any]:
        """Return a value in all places of an input, or a list of values. Raise NetworkProblem."""
        kind, shape = self.network.inputs[name].type, self.shapes[name]
        try:
            plain = np.array(str(value or "") if kind == "object" and value == 0 else value)
            array = plain.astype(kind)
            exact = np.isfinite(array).all() if kind in FLOATS else (array == plain).all()
        except (ValueError, TypeError, OverflowError):
            exact = False
        if not exact:
            raise NetworkProblem(f"has the input '{name}' of {kind}, which cannot be {shown(value)}")
        return np.broadcast_to(array.reshape(shape) if isinstance(value, tuple) else array, shape).copy()

    def run(self, values: Mapping[str, NDArray[Any]], outputs: Sequence[str]) -> list[NDArray[Any]]:
        """Return outputs by name. Raise NetworkProblem."""
        try:
            return list(self._session.run(list(outputs), dict(values)))
        except Exception as error:  # noqa: BLE001 - its errors have no common class
            raise NetworkProblem(_reason(error)) from None


def _tensor(argument: Any) -> Tensor:
    """Return an argument of a session; a type such as "seq(tensor(float))" is kept as it is."""
    kind = (
        argument.type.removeprefix("tensor(").removesuffix(")")
        if argument.type.startswith("tensor(")
        else argument.type
    )
    shape = tuple(
        dimension if isinstance(dimension, int) and dimension > 0 else None for dimension in argument.shape or ()
    )
    return Tensor(argument.name, _TYPE_NAMES.get(kind, kind), shape)


def _content(path: Path, used: int, limit: Callable[[int], None]) -> bytes:
    """Return the content of a file. `used`: the bytes of the files before it. Raise OSError, NetworkProblem."""
    with open_regular(path, follow_link=True) as file:
        size = os.fstat(file.fileno()).st_size
        if used + size > MAX_NETWORK_BYTES:
            raise NetworkProblem(f"has more than {MAX_NETWORK_BYTES // 1_000_000:,} MB with its weights, the maximum")
        limit(used + size)
        return file.read(size)


def _data_files(content: bytes, folder: Path, workspace: Workspace, limit: Callable[[int], None]) -> dict[str, bytes]:
    """Return name -> content of the files with weights. Raise NetworkProblem."""
    names = list(dict.fromkeys(_locations(content)))
    files = dict[str, bytes]()
    if len(names) > _MAX_DATA_FILES:
        raise NetworkProblem(f"has weights in {len(names):,} files; at most {_MAX_DATA_FILES:,} are read")
    used = len(content)
    for name in names:
        try:
            path = workspace.file(str(PurePath(folder, name)))
            files[name] = _content(path, used, limit)
        except PathError as error:
            raise NetworkProblem(f"has weights in another file, but {error}") from None
        except OSError as error:
            reason = f"cannot be read: {error.strerror}"
            raise NetworkProblem(f"has weights in '{escaped_line(name)}', which {reason}") from None
        used += len(files[name])
    return files


def _locations(content: bytes) -> Iterator[str]:
    """Yield the names of the files with weights. onnxruntime refuses any that is not among them."""
    for match in _LOCATION.finditer(content):
        low, high = match.groups()
        size = (low[0] & 0x7F) + (high[0] << 7) if low else high[0]
        yield content[match.end() : match.end() + size].decode("utf-8", errors="replace")


@dataclass(frozen=True, slots=True)
class _Selections:
    """The values of a network that operations which hide NaN read."""

    # computed values of the main graph that such an operation reads, also one in a subgraph
    watched: frozenset[str] = frozenset()
    # such operations in subgraphs and functions that read a value which is computed there
    blind: frozenset[str] = frozenset()
    outputs: frozenset[str] = frozenset()  # of the network


def _selections(content: bytes) -> _Selections:
    if not any(kind in content for kind in _HIDING):
        return _Selections()
    try:
        # Slices of a view are no copies.
        model = memoryview(content)
        graphs, functions = _fields(model, _GRAPH), _fields(model, _FUNCTION)
        outputs = {name for graph in graphs for name in _named(graph, _GRAPH_OUTPUT)}
        nodes = [node for graph in graphs for node in _fields(graph, _GRAPH_NODE)]
        computed = {name for node in nodes for name in _texts(node, _NODE_OUTPUT)}
        outer = {name for graph in graphs for key in (_GRAPH_INPUT, _GRAPH_TENSOR) for name in _named(graph, key)}
        outer |= {"", *computed}
        hiding = _hiding(nodes)
        watched = {name for node in hiding for name in _texts(node, _NODE_INPUT)}
        unseen = [node for node in hiding if not {*_texts(node, _NODE_INPUT)} <= outer]
        unseen += _hiding([node for function in functions for node in _fields(function, _FUNCTION_NODE)])
        blind = {name for node in unseen for name in _texts(node, _NODE_OPERATION)}
    except (IndexError, KeyError, UnicodeDecodeError):
        return _Selections()  # a damaged file, which onnxruntime refuses
    return _Selections(frozenset(watched & computed), frozenset(blind), frozenset(outputs))


def _hiding(nodes: list[memoryview]) -> list[memoryview]:
    """Return the nodes that hide NaN, among nodes and those in their subgraphs, such as of If, Loop or Scan."""
    everywhere = [*nodes]
    for node in everywhere:  # grows
        for attribute in _fields(node, _NODE_ATTRIBUTE):
            for graph in _fields(attribute, _ATTRIBUTE_GRAPH):
                everywhere += _fields(graph, _GRAPH_NODE)
    return [node for node in everywhere if not _HIDING.isdisjoint(_fields(node, _NODE_OPERATION))]


def _named(graph: memoryview, number: int) -> Iterator[str]:
    """Yield the names of the inputs, outputs or weights of a graph."""
    for part in _fields(graph, number):
        yield from _texts(part, _TENSOR_NAME if number == _GRAPH_TENSOR else 1)


def _texts(message: memoryview, number: int) -> list[str]:
    return [str(text, "utf-8") for text in _fields(message, number)]


def _fields(message: memoryview, number: int) -> list[memoryview]:
    """Return the texts or messages of one number in a protocol buffer. Raise NetworkProblem.

    Raise IndexError, KeyError if it is damaged.
    """
    contents = list[memoryview]()
    place = 0
    for _ in range(_MAX_FIELDS):
        if place >= len(message):
            return contents
        key, begin = _varint(message, place)
        size, begin = _varint(message, begin) if key & 7 in {0, 2} else ({1: 8, 5: 4}[key & 7], begin)
        place = begin + (size if key & 7 else 0)
        if key == number << 3 | 2:
            contents.append(message[begin:place])
    raise NetworkProblem(f"has more than {_MAX_FIELDS:,} fields in one message beside an operation such as ArgMax")


def _varint(message: memoryview, place: int) -> tuple[int, int]:
    """Return a number of at most 10 bytes, and the place after it. Raise IndexError."""
    if message[place] < 0x80:
        return message[place], place + 1
    length = next(index for index in range(11) if message[place + index] < 0x80 or index == 10) + 1
    return sum((byte & 0x7F) << 7 * index for index, byte in enumerate(message[place : place + length])), place + length


def _field(number: int, content: bytes) -> bytes:
    """Return a text or message as a field of a protocol buffer; its size takes 5 bytes."""
    size = len(content)
    return bytes([number << 3 | 2, *(size >> shift & 0x7F | 0x80 for shift in (0, 7, 14, 21)), size >> 28]) + content


def _reason(error: Exception) -> str:
    text = _PATH.sub("", " ".join(str(error).split()))
    if "bad_alloc" in text:
        return TOO_MUCH_MEMORY
    return f"is refused by onnxruntime: {escaped_line(text[:_MAX_MESSAGE_CHARS])}"
