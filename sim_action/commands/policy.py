"""A trained network drives the joints: `policy: {file: walk.onnx, observation: [...], action: {...}}`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Final, Self

from pydantic import BeforeValidator, Field
from typing_extensions import override

from sim_action.commands import ClosedLoop, CommandSource, Controller
from sim_action.commands.controller_answers import Saturation
from sim_action.commands.policy_controller import (
    Input,
    Motors,
    NetworkController,
    PolicyAction,
    PolicyHistory,
    Schedule,
)
from sim_action.commands.policy_metadata import Stated, contradictions, stated_in
from sim_action.commands.policy_terms import (
    Layout,
    Picture,
    PictureInput,
    Term,
    selected,
    selection_problems,
    sensor_sizes,
)
from sim_action.commands.twist import TwistSegment
from sim_action.core.errors import SourceProblem
from sim_action.core.field_types import NamesFile, PositiveHertz
from sim_action.core.lazy_numpy import NDArray
from sim_action.core.units import UnitError
from sim_action.core.wording import counted, did_you_mean, escaped_line, shown
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_document import SpecProblems
from sim_action.networks.network_check import checked_network
from sim_action.networks.onnx_network import (
    INSTALL_HINT,
    NUMERIC,
    PACKAGE,
    Feed,
    Network,
    NetworkProblem,
    Session,
    Tensor,
    is_installed,
)
from sim_action.robot.model.robot_model import RobotModel
from sim_action.state.command import Answer
from sim_action.state.observation import Observation
from sim_action.world.scene import Scene

_NUMBER: Final[dict[str, Any]] = {"type": "number"}
_TEXT: Final[dict[str, Any]] = {"type": "string"}
_SPEEDS: Final = ("linear", "lateral", "angular")
_INPUT_KEYS: Final = ("inputs", "constants", "pictures", "state")  # the keys that name inputs of the network
_Constant = bool | int | Annotated[float, Field(allow_inf_nan=False)] | str


def _also(*others: dict[str, Any]) -> Callable[[dict[str, Any]], None]:
    """Return a change of the JSON Schema of a list, whose items may have other types, too."""

    def change(schema: dict[str, Any]) -> None:
        schema["items"] = {"anyOf": [*others, schema["items"]]}

    return change


def _segments(value: object) -> object:
    """Return `[vx, vy, wz]` as one segment."""
    if not isinstance(value, tuple) or not value or any(isinstance(entry, dict) for entry in value):
        return value
    if len(value) != len(_SPEEDS):
        raise ValueError(
            f"expected [vx, vy, wz] or a list of segments such as {{linear: 0.5, for: 2 s}}, found {value}"
        )
    return (dict(zip(_SPEEDS, value, strict=True)),)


def _no_constant(value: object) -> object:
    """Return the terms of an input. Raises ValueError for a constant."""
    is_constant = isinstance(value, bool | int | float)
    if is_constant:
        raise ValueError(f"expected a list of terms, found {shown(value)}; give a constant in 'constants'")
    return value


_Terms = Annotated[tuple[Term, ...], Field(min_length=1, json_schema_extra=_also(_TEXT)), BeforeValidator(_no_constant)]


class PolicyCommands(CommandSource):
    """Runs a trained network in ONNX format that commands joints, without a line of Python.

    At every tick, the terms of `observation` are joined to the input of the network, and its output becomes targets of
    the joints: `target = offset + scale * output`. A term is a name, or a map such as `{term: base.angular, scale:
    0.25}`. All are in SI units:

    - `base.linear`, `base.angular`: velocity of the base link in its own frame; `base.rpy`: roll, pitch and yaw;
      `base.height`: z of its origin in the world;
    - `gravity`: the direction of `world.gravity` as a unit vector in the frame of the base link;
    - `joints.position` (minus the `offset` of the term, else of a position action), `joints.velocity`,
      `joints.effort`;
    - `last_action`: the last output of the network after `clip`, 0 at first;
    - `commands`: the wanted velocity as vx, vy, wz, from the key `commands`;
    - `time` in s; `phase.sin` and `phase.cos` of a gait with a `period`, and a `shift` as a share of it;
    - `sensors.NAME.COLUMN`: the latest reading of a sensor, such as `sensors.imu.angular_velocity_xyz`.

    The joints are all joints of the model in its order, without followers. `order` states others: check it, because
    simulators number joints in different ways. `order`, `action` and `observation` may be left out if the file itself
    states them, as mjlab and BeyondMimic write them. Inputs that are no observation get `constants`, or `pictures` of a
    camera, whose values are `(pixel * scale - mean) / std`.

    An output may also be a chunk of several actions, of which `execute` are executed, or which `ensemble` averages; or
    a score for each of its `choices`.

    With `stiffness` and `damping`, the effort is `stiffness * (target - position) - damping * velocity`, computed at
    every physics step, within the effort limits of the model. Without them, the servo of the model holds a position.

    The network runs on the processor in one thread, with the same result each time. A policy counts as code. It needs
    `pip install 'sim-action[policy]'`, and in a workflow the input `extras: policy`.
    """

    key: ClassVar[str] = "policy"
    runs_user_code: ClassVar[bool] = True
    package: ClassVar[str | None] = PACKAGE
    map_key: ClassVar[str | None] = "file"

    policy: Annotated[str, NamesFile(), Field(min_length=1, description="path of the ONNX file")]
    action: Annotated[
        PolicyAction | None, Field(description="meaning of the output; needed if the file does not state it")
    ] = None
    observation: Annotated[
        tuple[Term, ...],
        Field(
            description="terms of the only input, or of the only one that no other key names, in their order",
            json_schema_extra=_also(_TEXT),
        ),
    ] = ()
    inputs: Annotated[
        Mapping[str, _Terms], Field(description="the terms of each input by its name, if there are several")
    ] = {}
    constants: Annotated[
        Mapping[str, _Constant | tuple[_Constant, ...]],
        Field(description="inputs that are always the same, such as `is_training: false`: a value, or a list of them"),
    ] = {}
    pictures: Annotated[Mapping[str, Picture], Field(description="inputs that are the image of a camera")] = {}
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
        return () if is_installed() else (f"policy {self.policy}: the network was not opened: {INSTALL_HINT}",)

    def tick_rate(self, physics_rate: float) -> float:
        """See CommandSource.tick_rate: soft motors act at every physics step."""
        return physics_rate if self.action is not None and self.action.is_soft else self.rate

    @override
    def completed(self, workspace: Workspace) -> Self:
        """See CommandSource.completed: the network states the keys that are not given."""
        network = self._read(workspace)
        if not isinstance(network, Network):
            return self
        try:
            stated = stated_in(network.metadata, self.order)
        except NetworkProblem:
            return self  # reported by `problems`
        changes: dict[str, Any] = {}
        if self.order is None and stated.joints:
            changes["order"] = stated.joints
        action = self.action or (PolicyAction(joints="position") if stated.action else None)
        if action is not None and action.joints == "position":
            own = action.model_fields_set if self.action else ()
            action = action.model_copy(
                update={key: setting for key, setting in stated.action.items() if key not in own}
            )
        changes["action"] = action
        if stated.names and not stated.unknown and not self.observation and len(self._free(network)) == 1:
            omitted = {"frames"} if self.history else set()
            terms = ({key: term[key] for key in term.keys() - omitted} for term in stated.terms)
            changes["observation"] = tuple(map(Term.model_validate, terms))
        return self.model_copy(update=changes)

    def problems(self, workspace: Workspace) -> SpecProblems:
        """Yield keys that do not fit together, and problems with the network, which another process opens."""
        network = self._read(workspace)
        stated = Stated()
        if isinstance(network, str):
            yield ("policy",), network
        elif network is not None:
            try:
                stated = stated_in(network.metadata, self.order)
            except NetworkProblem as error:
                yield ("policy",), f"{self.policy} {error}"
            yield from self._name_problems(network)
        yield from self._own_problems(stated)

    def _own_problems(self, stated: Stated) -> SpecProblems:
        if self.action is None and is_installed():
            yield ("action",), "the key 'action' is missing, and the network does not state it"
        if stated.without_gains and self.action and (self.action.joints, self.action.is_soft) == ("position", False):
            stated_gains = (
                f"the network states an actuator of joint '{stated.without_gains}', not the gains of its training"
            )
            yield ("action",), f"{stated_gains}; give 'stiffness' and 'damping'"
        if not (self.observation or self.inputs or self.pictures) and is_installed():
            unknown = (
                f"; the network states '{stated.unknown[0]}', for which there is no term" if stated.unknown else ""
            )
            yield ("observation",), f"give the terms in 'observation' or 'inputs', or give 'pictures'{unknown}"
        reads = any(term.term == "commands" for _, _, term in self._terms())
        if reads != bool(self.commands):
            missing = "add 'commands: [vx, vy, wz]' for the term 'commands'"
            yield ("commands",), missing if reads else "no term reads them; add 'commands' to the observation"
        endless = [index for index, segment in enumerate(self.commands[:-1]) if segment.duration is None]
        yield from ((("commands", index), "only the last segment may omit 'for'") for index in endless)
        if (
            self.history is not None
            and self.history.order == "frame"
            and any(term.frames for *_, term in self._terms())
        ):
            yield ("history", "order"), "terms with 'frames' of their own need 'order: term'"
        if self.action is not None:
            yield from self.action.problems(is_perfect=self.is_perfect)

    def _name_problems(self, network: Network) -> SpecProblems:
        """Yield names that the network does not have, inputs without values, and types that policies do not have."""
        for key in _INPUT_KEYS:
            for name in getattr(self, key):
                if name not in network.inputs:
                    yield (key, name), f"the network has no input '{name}'{did_you_mean(name, network.inputs)}"
        for name, source in self.state.items():
            if source not in network.outputs:
                yield ("state", name), f"the network has no output '{source}'{did_you_mean(source, network.outputs)}"
        free = self._free(network)
        if self.observation and len(free) != 1:
            names = ", ".join(f"'{tensor.name}' ({tensor})" for tensor in free) or "none"
            where = "'inputs', 'constants', 'pictures' or 'state'"
            yield ("observation",), f"is for one input, and the network has {names}; name them in {where}"
        elif not self.observation and free and (self.inputs or self.pictures):
            where = "'inputs', 'constants', 'pictures' or 'state'"
            yield ("inputs",), f"the network also takes '{free[0].name}' ({free[0]}); add it to {where}"
        yield from self._output_problems(network)

    def _output_problems(self, network: Network) -> SpecProblems:
        results = [name for name in network.outputs if name not in self.state.values()]
        if self.output is not None and self.output not in network.outputs:
            hint = did_you_mean(self.output, network.outputs)
            yield ("output",), f"the network has no output '{self.output}'{hint}"
        elif self.output is None and len(results) != 1:
            yield ("policy",), f"has several outputs; add 'output' (allowed: {', '.join(results)})"
        used = {self._output(network) or "", *self.state.values()}
        tensors = [(tensor, "input", name in self.constants) for name, tensor in network.inputs.items()]
        tensors += [(tensor, "output", False) for name, tensor in network.outputs.items() if name in used]
        for tensor, what, is_constant in tensors:
            if tensor.type not in NUMERIC and not (is_constant and tensor.type == "object"):
                kind = escaped_line(tensor.type.replace("object", "text"))
                yield (
                    ("policy",),
                    f"{self.policy}: {what} '{escaped_line(tensor.name)}' is of {kind}, and not of numbers",
                )

    def _free(self, network: Network) -> list[Tensor]:
        named = {name for key in _INPUT_KEYS for name in getattr(self, key)}
        return [tensor for name, tensor in network.inputs.items() if name not in named]

    def _terms(self) -> Iterator[tuple[str, int, Term]]:
        for name, terms in self._groups():
            for index, term in enumerate(terms):
                yield name, index, term

    def _groups(self) -> list[tuple[str, tuple[Term, ...]]]:
        """Return the terms of each input; the name of the only one is empty."""
        return [*self.inputs.items(), *([("", self.observation)] if self.observation else [])]

    def _output(self, network: Network) -> str | None:
        names = [name for name in network.outputs if name not in self.state.values()]
        return self.output or (names[0] if len(names) == 1 else None)

    def _inputs(self, network: Network) -> dict[str, tuple[Term, ...]]:
        free = self._free(network)
        groups = {name or (free[0].name if len(free) == 1 else ""): terms for name, terms in self._groups()}
        return {name: terms for name, terms in groups.items() if name in network.inputs}

    def _frames(self, term: Term) -> int:
        return term.frames or (self.history.frames if self.history else 1)

    def _feeds(self, network: Network, layout: Layout, scene: Scene) -> dict[str, Feed]:
        """Return the feed of each input that is named, and whose size is known."""
        feeds = {name: Feed(value=value) for name, value in self.constants.items() if name in network.inputs}
        for name, picture in self.pictures.items():
            if name in network.inputs and not list(picture.problems(scene)):
                feeds[name] = Feed(shape=picture.shape(scene, network.inputs[name]))
        for name, terms in self._inputs(network).items():
            sizes = [term.size(layout) for term in terms]
            if None not in sizes:
                total = sum((size or 0) * self._frames(term) for size, term in zip(sizes, terms, strict=True))
                feeds[name] = Feed(total, max(map(self._frames, terms)))
        return feeds

    def _read(self, workspace: Workspace, feeds: Mapping[str, Feed] = MappingProxyType({})) -> Network | str | None:
        """Return the network, or the reason why it cannot be used; None without onnxruntime."""
        try:
            workspace.file(self.policy)
            return checked_network(workspace, self.policy, feeds) if is_installed() else None
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
        yield from self._order_problems(model)
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
        if self.action is None:
            return
        fitting = [*self.action.joint_problems(layout.joints)]
        yield from ((("action", *path), text) for path, text in fitting)
        for name, index, term in self._terms():
            place = ("inputs", name, index) if name else ("observation", index)
            yield from (((*place, *path), text) for path, text in term.problems(scene, layout))
        for name, picture in self.pictures.items():
            yield from ((("pictures", name, *path), text) for path, text in picture.problems(scene))
        if not fitting:
            yield from self._network_problems(layout, scene)

    def _order_problems(self, model: RobotModel) -> SpecProblems:
        for index, name in enumerate(self.order or ()):
            if name in (self.order or ())[:index] and name in model.joints_by_name:
                yield ("order", index), f"joint '{name}' stands twice; remove one of them"
            elif (problem := model.why_not_driven(name)) is not None and name in model.joints_by_name:
                yield ("order", index), problem

    def _network_problems(self, layout: Layout, scene: Scene) -> SpecProblems:
        """Yield what differs from the texts of the network, and sizes that do not fit, as a run with zeros shows."""
        network = self._read(scene.workspace)
        if not isinstance(network, Network):
            return
        with suppress(NetworkProblem):
            yield from contradictions(
                stated_in(network.metadata, layout.joints), layout, self.action, self.observation, self._frames
            )
        feeds = self._feeds(network, layout, scene)
        shapes = {name: network.inputs[name].shapes(feed) for name, feed in feeds.items()}
        for name, terms in self._inputs(network).items():
            if name in feeds and not shapes[name]:
                parts = [(f"{term.term} {term.size(layout)}", self._frames(term)) for term in terms]
                texts = ", ".join(f"{part} x {frames}" if frames > 1 else part for part, frames in parts)
                gives = f"the observation gives {counted(feeds[name].size or 0, 'number')}: {texts}"
                place = ("inputs", name) if name in self.inputs else ("observation",)
                yield place, f"the network's input '{name}' takes {network.inputs[name]}, and {gives}"
        if not all(shapes.values()):
            return
        # Without its size, a first dimension from the training is no batch.
        repeats = any(feed.size and math.prod(shapes[name][0]) != feed.size for name, feed in feeds.items())
        differs = any(shapes[name] != network.inputs[name].shapes(Feed()) for name in feeds)
        if network.results is None or repeats or differs:
            again = self._read(scene.workspace, feeds)
            if isinstance(again, str):
                yield ("policy",), again
            network = again if isinstance(again, Network) else network
        yield from self._result_problems(network, layout)

    def _result_problems(self, network: Network, layout: Layout) -> SpecProblems:
        output = self._output(network) or ""
        size = (network.results or {}).get(output)
        if size is not None and self.action is not None:
            yield from self.action.output_problems(network.outputs[output], size, layout.joints)

    def _layout(self, scene: Scene) -> Layout:
        """Return the joints and sizes. Raises UnitError."""
        joints = selected(scene.model, self.order)
        action = self.action
        offset = action.offset if action is not None and action.joints == "position" else 0.0
        x, y, z = scene.world.gravity_xyz
        weight = scene.world.weight or 1.0
        down = (x / weight, y / weight, z / weight)
        return Layout(scene.model, joints, len(joints), scene.joint_positions, offset, sensor_sizes(scene), down)

    @override
    def joints(self, scene: Scene) -> frozenset[str]:
        return frozenset(selected(scene.model, self.order))

    def _session(self, scene: Scene, layout: Layout) -> tuple[Session, str, dict[str, NDArray[Any]]]:
        """Return the network, the name of its output and values for constants and states. Raises SourceProblem."""
        try:
            session = Session(scene.workspace, self.policy)
            network = session.fit(self._feeds(session.network, layout, scene))
            values = {name: self.constants.get(name, 0) for name in [*self.constants, *self.state]}
            fixed = {name: session.constant(name, value) for name, value in values.items()}
        except ImportError:
            raise SourceProblem(INSTALL_HINT, "policy") from None
        except NetworkProblem as error:
            raise SourceProblem(f"{self.policy} {error}", "policy") from None
        except PathError as error:
            raise SourceProblem(str(error), "policy") from None
        except OSError as error:
            raise SourceProblem(f"{self.policy} cannot be read: {error.strerror}", "policy") from None
        output = self._output(network)
        if output is None or network.results is None:
            raise SourceProblem(f"{self.policy} has other inputs and outputs than before", "policy")
        for _, problem in self._result_problems(network, layout):
            raise SourceProblem(problem, "action")
        return session, output, fixed

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open. Raises SourceProblem, ScriptError."""
        layout = self._layout(scene)
        session, output, fixed = self._session(scene, layout)
        if self.action is None:
            raise SourceProblem("the key 'action' is missing", "policy")
        network = session.network
        schedule = Schedule.of(self.commands)
        inputs: dict[str, Input | PictureInput] = {
            name: Input(session, name, terms, layout, schedule, self.history)
            for name, terms in self._inputs(network).items()
        }
        for name, picture in self.pictures.items():
            inputs[name] = PictureInput(picture, network.inputs[name], session.shapes[name])
        policy = NetworkController(self.policy, session, inputs, fixed, self.state, output, self.action, layout.joints)
        motors = Motors.of(self.action, layout)
        saturation = Saturation(scene.model, self.policy)
        if session.blind:
            where = "inside a subgraph or a function of the network, where NaN cannot be watched: its result hides them"
            saturation.notes.append(f"{self.policy} has {', '.join(session.blind)} {where}")
        period = round(self.tick_rate(scene.physics.rate) / self.rate)
        ticks = iter(range(1 << 62))

        def command(now: Observation) -> Answer:
            if next(ticks) % period == 0:
                policy.run(now)
            return saturation.clip(motors.targets(policy.action, now))

        senses = bool(self.pictures) or any(term.sensor for _, _, term in self._terms())
        return ClosedLoop(command, senses=senses, notes=saturation.notes)
