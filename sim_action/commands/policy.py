"""A trained network drives the joints: `policy: {file: walk.onnx, observation: [...], action: {...}}`."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final

from pydantic import BeforeValidator, Field
from typing_extensions import override

from sim_action.commands import ClosedLoop, CommandSource, Controller
from sim_action.commands.controller_answers import Saturation
from sim_action.commands.onnx_network import (
    INSTALL_HINT,
    PACKAGE,
    Network,
    NetworkProblem,
    Session,
    Tensor,
    float_problem,
    network_signature,
    read_network,
)
from sim_action.commands.policy_controller import (
    Input,
    Memory,
    Motors,
    NetworkController,
    PolicyAction,
    PolicyHistory,
    Schedule,
)
from sim_action.commands.policy_terms import (
    Layout,
    Term,
    per_joint_problems,
    selected,
    selection_problems,
    sensor_sizes,
)
from sim_action.commands.twist import TwistSegment
from sim_action.core.errors import SourceProblem
from sim_action.core.field_types import NamesFile, PositiveHertz
from sim_action.core.units import UnitError
from sim_action.core.wording import counted, did_you_mean
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.state.command import Answer
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation

_NUMBER: Final[dict[str, Any]] = {"type": "number"}
_TEXT: Final[dict[str, Any]] = {"type": "string"}
_SPEEDS: Final = ("linear", "lateral", "angular")


def _also(*others: dict[str, Any]) -> Callable[[dict[str, Any]], None]:
    """Return a change of the JSON Schema of a list, whose items may have other types, too."""

    def change(schema: dict[str, Any]) -> None:
        schema["items"] = {"anyOf": [*others, schema["items"]]}

    return change


def _segments(value: object) -> object:
    """Return `[vx, vy, wz]` as one segment."""
    if not isinstance(value, tuple) or not value or any(isinstance(each, dict) for each in value):
        return value
    if len(value) != len(_SPEEDS):
        raise ValueError(
            f"expected [vx, vy, wz] or a list of segments such as {{linear: 0.5, for: 2 s}}, found {value}"
        )
    return (dict(zip(_SPEEDS, value, strict=True)),)


class PolicyCommands(CommandSource):
    """Runs a trained network in ONNX format that commands joints, without a line of Python.

    At every tick, the terms of `observation` are joined to the input of the network, and its output becomes targets of
    the joints: `target = offset + scale * output`. A term is a name, or a map such as `{term: base.angular, scale:
    0.25}`. All are in SI units:

    - `base.linear`, `base.angular`: velocity of the base link in its own frame; `base.rpy`: roll, pitch and yaw;
      `base.height`: z of its origin in the world;
    - `gravity`: the direction of `world.gravity` as a unit vector in the frame of the base link;
    - `joints.position` (minus the `offset` of a position action, or its own `offset`), `joints.velocity`,
      `joints.effort`;
    - `last_action`: the last output of the network after `clip`, 0 at first;
    - `commands`: the wanted velocity as vx, vy, wz, from the key `commands`;
    - `time` in s; `phase.sin` and `phase.cos` of a gait with a `period`, and a `shift` as a share of it;
    - `sensors.NAME.COLUMN`: the latest reading of a sensor, such as `sensors.imu.angular_velocity_xyz`.

    The joints are those of the model, in its order, without those that mimic others. `order` states others: names and
    patterns. Check it: simulators number joints in different ways. Names and sizes of inputs and outputs are compared
    with the observation and the joints before the run.

    Trainers often use soft motors: with `stiffness` and `damping`, the effort is `stiffness * (target - position) -
    damping * velocity`, computed at every physics step, within the effort limits of the model. Without them, a position
    is held by the servo of the model, as with `joints`. All keys can be written below `policy`:
    `policy: {file: walk.onnx, ...}`.

    The network runs on the processor in one thread, with the same result each time. Weights must be inside the file. A
    policy counts as code. It needs `pip install 'sim-action[policy]'`, and in a workflow the input `extras: policy`.
    """

    runs_user_code: ClassVar[bool] = True
    map_key: ClassVar[str | None] = "file"

    policy: Annotated[str, NamesFile(), Field(min_length=1, description="path of the ONNX file")]
    action: Annotated[PolicyAction, Field(description="meaning of the output")]
    observation: Annotated[
        tuple[Term, ...],
        Field(description="terms of the only input, in their order", json_schema_extra=_also(_TEXT)),
    ] = ()
    inputs: Annotated[
        Mapping[str, Annotated[tuple[Term, ...], Field(min_length=1, json_schema_extra=_also(_TEXT))]],
        Field(description="in place of `observation`: the terms of each input by its name, if there are several"),
    ] = {}
    order: Annotated[
        tuple[str, ...] | None,
        Field(min_length=1, description="joints in the order of the network: names and patterns; default: all"),
    ] = None
    commands: Annotated[
        tuple[TwistSegment, ...],
        BeforeValidator(_segments),
        Field(
            description="wanted velocity: `[vx, vy, wz]`, or a list of segments as in `twist`",
            json_schema_extra=_also(_NUMBER, _TEXT),
        ),
    ] = ()
    history: Annotated[PolicyHistory | None, Field(description="past observations; default: none")] = None
    state: Annotated[
        Mapping[str, str],
        Field(description="memory of a recurrent network: name of each input -> output that sets it; 0 at first"),
    ] = {}
    output: Annotated[str | None, Field(description="name of the output; needed if there are several")] = None
    rate: Annotated[PositiveHertz, Field(description="rate of the ticks at which the network runs, as in its training")]

    @property
    @override
    def code(self) -> str:
        return f"policy {self.policy}"

    @property
    @override
    def unchecked(self) -> tuple[str, ...]:
        return () if importlib.util.find_spec(PACKAGE) else (f"policy {self.policy}: {INSTALL_HINT}",)

    def tick_rate(self, physics_rate: float) -> float:
        """See CommandSource.tick_rate: soft motors act at every physics step."""
        return physics_rate if self._has_soft_motors else self.rate

    @property
    def _has_soft_motors(self) -> bool:
        return (self.action.stiffness, self.action.damping) != (None, None)

    def problems(self, workspace: Workspace) -> SpecProblems:
        """Yield keys that do not fit together, and problems with the file. It is not run."""
        yield from self._own_problems()
        network = self._read(workspace)
        if isinstance(network, str):
            yield ("policy",), network
        else:
            yield from self._name_problems(network)

    def _own_problems(self) -> SpecProblems:
        if bool(self.observation) == bool(self.inputs):
            yield ("observation",), "give the terms in either 'observation' or 'inputs'"
        reads = any(term.term == "commands" for _, _, term in self._terms())
        if reads != bool(self.commands):
            missing = "add 'commands: [vx, vy, wz]' for the term 'commands'"
            yield ("commands",), missing if reads else "no term reads them; add 'commands' to the observation"
        endless = [index for index, segment in enumerate(self.commands[:-1]) if segment.duration is None]
        yield from ((("commands", index), "only the last segment may omit 'for'") for index in endless)
        action = self.action
        if action.joints == "position" and (action.stiffness is None) != (action.damping is None):
            yield ("action",), "a target position needs both of 'stiffness' and 'damping', or none of them"
        if action.joints == "velocity" and action.stiffness is not None:
            yield ("action", "stiffness"), "a target velocity has 'damping' alone"
        if action.joints == "effort" and self._has_soft_motors:
            yield ("action",), "an effort is applied directly; remove 'stiffness' and 'damping'"
        elif self._has_soft_motors and not self.is_perfect:
            yield ("action",), "'stiffness' and 'damping' cannot be combined with latency, jitter or dropouts"

    def _name_problems(self, network: Network) -> SpecProblems:
        """Yield names that the network does not have, and inputs without values."""
        for name in self.inputs:
            if name not in network.inputs:
                yield ("inputs", name), f"the network has no input '{name}'{did_you_mean(name, network.inputs)}"
        for name, source in self.state.items():
            if name not in network.inputs:
                yield ("state", name), f"the network has no input '{name}'{did_you_mean(name, network.inputs)}"
            if source not in network.outputs:
                yield ("state", name), f"the network has no output '{source}'{did_you_mean(source, network.outputs)}"
        given = {*self.inputs, *self.state}
        free = [tensor for name, tensor in network.inputs.items() if name not in given]
        if self.observation and len(free) != 1:
            names = ", ".join(f"'{tensor.name}' ({tensor})" for tensor in free) or "none"
            yield ("observation",), f"is for one input, and the network has {names}; name them in 'inputs' or 'state'"
        elif not self.observation and free:
            yield ("inputs",), f"the network also takes '{free[0].name}' ({free[0]}); add it to 'inputs' or 'state'"
        yield from self._output_problems(network)

    def _output_problems(self, network: Network) -> SpecProblems:
        results = [name for name in network.outputs if name not in self.state.values()]
        if self.output is not None and self.output not in network.outputs:
            hint = did_you_mean(self.output, network.outputs)
            yield ("output",), f"the network has no output '{self.output}'{hint}"
        elif self.output is None and len(results) != 1:
            yield ("policy",), f"has several outputs; add 'output' (allowed: {', '.join(results)})"
        used = network.outputs.get(self._output(network) or "")
        for tensor, what in [
            *((tensor, "input") for tensor in network.inputs.values()),
            *([(used, "output")] if used is not None else []),
        ]:
            if (problem := float_problem(tensor, what)) is not None:
                yield ("policy",), f"{self.policy}: {problem}"

    def _terms(self) -> Iterator[tuple[str, int, Term]]:
        for name, terms in self._groups():
            for index, term in enumerate(terms):
                yield name, index, term

    def _groups(self) -> list[tuple[str, tuple[Term, ...]]]:
        return [*self.inputs.items()] or [("", self.observation)]

    def _output(self, network: Network) -> str | None:
        names = [name for name in network.outputs if name not in self.state.values()]
        return self.output or (names[0] if len(names) == 1 else None)

    def _input(self, network: Network, name: str) -> Tensor | None:
        names = [name] if name else [each for each in network.inputs if each not in self.state]
        return network.inputs.get(names[0]) if len(names) == 1 else None

    def _read(self, workspace: Workspace, read: Callable[[Path], Network] = network_signature) -> Network | str:
        """Return the network, or the reason why there is none; by default, without its content."""
        try:
            return read(workspace.file(self.policy))
        except PathError as error:
            return str(error)
        except OSError as error:
            return f"{self.policy} cannot be read: {error.strerror}"
        except NetworkProblem as error:
            return f"{self.policy} {error}"

    def model_problems(self, scene: Scene) -> SpecProblems:
        """See CommandSource.model_problems: unknown joints, and sizes that do not fit the network."""
        model = scene.model
        problems = [*selection_problems(model, self.order or ())]
        yield from ((("order", index), text) for index, text in problems)
        for index, name in enumerate(self.order or ()):
            if name in (self.order or ())[:index] and name in model.joints_by_name:
                yield ("order", index), f"joint '{name}' stands twice; remove one of them"
            elif (problem := model.why_not_driven(name)) is not None and name in model.joints_by_name:
                yield ("order", index), problem
        try:
            layout = self._layout(scene)
        except UnitError:
            return  # reported for robot.joints
        if not layout.joints:
            if self.order is None:
                yield (), "no joint of the model has a motor"
            elif not problems:
                yield ("order",), "none of these joints has a motor of its own"
            return
        found = [
            *per_joint_problems("scale", self.action.scale, layout.joints),
            *per_joint_problems("offset", self.action.offset, layout.joints),
            *per_joint_problems("stiffness", self.action.stiffness, layout.joints),
            *per_joint_problems("damping", self.action.damping, layout.joints),
        ]
        yield from ((("action", *path), text) for path, text in found)
        for name, index, term in self._terms():
            place = ("inputs", name, index) if name else ("observation", index)
            yield from (((*place, *path), text) for path, text in term.problems(scene, layout))
        if isinstance(network := self._read(scene.workspace), Network):
            yield from self._size_problems(network, layout)

    def _size_problems(self, network: Network, layout: Layout) -> SpecProblems:
        frames = self.history.frames if self.history else 1
        for name, terms in self._groups():
            tensor, sizes = self._input(network, name), [term.size(layout) for term in terms]
            if tensor is None or tensor.size is None or None in sizes or not terms:
                continue
            total = frames * sum(size for size in sizes if size is not None)
            if total != tensor.size:
                parts = ", ".join(f"{term.term} {size}" for term, size in zip(terms, sizes, strict=True))
                more = f", {frames} times" if frames > 1 else ""
                key = ("inputs", name) if name else ("observation",)
                size = counted(tensor.size, "number")
                found = f"'{tensor.name}' has {size}, the observation gives {total}: {parts}{more}"
                yield key, f"the network's input {found}"
        tensor = network.outputs.get(self._output(network) or "")
        if tensor is not None and tensor.size not in (None, layout.actions):
            joints = ", ".join(layout.joints[:20])
            size, needed = counted(tensor.size, "number"), counted(layout.actions, "joint")
            found = f"'{tensor.name}' has {size}, for {needed}: {joints}"
            yield ("action",), f"the network's output {found}; name those of the network in 'order'"

    def _layout(self, scene: Scene) -> Layout:
        """Return the joints and sizes. Raises UnitError."""
        joints = selected(scene.model, self.order)
        offset = self.action.offset if self.action.joints == "position" else 0.0
        x, y, z = scene.world.gravity_xyz
        weight = scene.world.weight or 1.0
        down = (x / weight, y / weight, z / weight)
        return Layout(scene.model, joints, len(joints), scene.joint_positions, offset, sensor_sizes(scene), down)

    @override
    def joints(self, scene: Scene) -> frozenset[str]:
        return frozenset(selected(scene.model, self.order))

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open. Raises SourceProblem, ScriptError."""
        network = self._read(scene.workspace, read_network)
        if isinstance(network, str):
            raise SourceProblem(network, "policy")
        layout, tensor = self._layout(scene), network.outputs.get(self._output(network) or "")
        groups = [(self._input(network, name), terms) for name, terms in self._groups()]
        if tensor is None or any(each is None for each, _ in groups):
            raise SourceProblem(f"{self.policy} has other inputs and outputs than before", "policy")
        try:
            session = Session(network)
        except ImportError:
            raise SourceProblem(INSTALL_HINT, "policy") from None
        except NetworkProblem as error:
            raise SourceProblem(f"{self.policy}: {error}", "policy") from None
        wanted = Schedule.of(self.commands)
        inputs = [Input(each, terms, layout, wanted, self.history) for each, terms in groups if each is not None]
        memory = {network.inputs[name]: source for name, source in self.state.items()}
        policy = NetworkController(
            self.policy, session, inputs, Memory.of(memory), tensor.name, layout, self.action.clip
        )
        motors = Motors.of(self.action, layout)
        saturation = Saturation(scene.model, self.policy)
        period = round(self.tick_rate(scene.physics.rate) / self.rate)
        ticks = iter(range(1 << 62))

        def command(now: Observation) -> Answer:
            if next(ticks) % period == 0:
                policy.run(now)
            return saturation.clip(motors.targets(policy.action, now))

        return ClosedLoop(command, senses=any(term.sensor for _, _, term in self._terms()), notes=saturation.notes)
