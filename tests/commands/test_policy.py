"""Networks as command sources: their keys, what is compared before the run, and what they read and command."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sim_action.commands import ClosedLoop
from sim_action.commands.policy import PolicyCommands
from sim_action.core.errors import ScriptError, SourceProblem
from sim_action.core.geometry import Pose, Twist, quaternion_from_rpy
from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from sim_action.state.command import JointTargets
from sim_action.state.observation import JointState, Observation
from sim_action.state.readings import ImuReading
from sim_action.world import Physics, World
from sim_action.world.scene import Fitting, Scene
from tests.onnx_files import (
    BOOL,
    DOUBLE,
    FLOAT,
    INT64,
    TEXT,
    in_process,
    integer,
    linear,
    model,
    node,
    number,
    part,
    recurrent,
    subgraph,
    tensor,
)
from tests.scenarios import told

ARM = Path(__file__).parents[2] / "examples/commands/arm.urdf"
DRIVEN = ("turntable", "shoulder", "elbow", "left_finger_joint")
KEYS: dict[str, Any] = {"policy": "a.onnx", "order": DRIVEN[:3], "rate": 60.0, "action": {"joints": "effort"}}


def text(policy: str) -> str:
    """A scenario; the policy is in line 3."""
    rate = "" if "rate:" in policy else ", rate: 60 Hz"
    return (
        "name: n\nrobot: {model: arm.urdf, base: fixed, joints: {shoulder: 10 deg}}\n"
        f"commands: {{policy: {{file: a.onnx, {policy}{rate}}}}}\n"
        "expect: [{joint: {name: elbow, at_most: 1}}]\ntime_limit: 1 s\n"
    )


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    in_process(monkeypatch)
    (tmp_path / "arm.urdf").write_text(ARM.read_text())
    return tmp_path


def identity(size: int) -> bytes:
    """A network whose output is its input."""
    return model([node("Identity", ["obs"], ["actions"])], {"obs": (1, size)}, {"actions": (1, size)}, kind=DOUBLE)


def opened(
    folder: Path, network: bytes, sensors: tuple[Fitting, ...] = (), *, world: World | None = None, **keys: Any
) -> ClosedLoop:
    (folder / "a.onnx").write_bytes(network)
    workspace = Workspace(folder, folder)
    robot = Robot.model_validate({"model": "arm.urdf", "base": "fixed", "joints": {"shoulder": "10 deg"}})
    scene = Scene(robot, load_model(robot, workspace), world or World(), Physics(), workspace, sensors=sensors)
    spec = PolicyCommands.model_validate({**KEYS, **keys})
    assert list(spec.problems(workspace)) == []
    assert list(spec.model_problems(scene)) == []
    controller = spec.open(scene)
    assert isinstance(controller, ClosedLoop)
    return controller


NOW = Observation(
    time=0.3,
    pose=Pose((1.0, 2.0, 0.5), quaternion_from_rpy(0.1, -0.2, 1.5)),
    twist=Twist((0.3, -0.4, 0.5), (0.6, 0.7, -0.8)),
    joints={name: JointState(0.1 * place, 0.01 * place, place) for place, name in enumerate(DRIVEN, 1)},
    sensors={"imu": ImuReading(0.0, (0.0, 0.0, 0.0, 1.0), (1.0, 2.0, 3.0), (0.0, 0.0, 9.8))},
)
IMU = (Fitting("imu", "imu", "base_link", 100.0),)


def matrix() -> list[list[float]]:
    """The rotation of the base in NOW, from the formula of roll, pitch and yaw."""
    (cr, cp, cy), (sr, sp, sy) = ([f(angle) for angle in (0.1, -0.2, 1.5)] for f in (math.cos, math.sin))
    return [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]


def in_base(vector: tuple[float, float, float]) -> list[float]:
    return [sum(matrix()[row][column] * vector[row] for row in range(3)) for column in range(3)]


def efforts(answer: object) -> list[float]:
    assert isinstance(answer, JointTargets)
    assert list(answer.effort) == ["turntable", "shoulder", "elbow"]
    return list(answer.effort.values())


HOME = math.radians(10)


@pytest.mark.parametrize(
    ("term", "values"),
    [
        ("base.linear", in_base((0.3, -0.4, 0.5))),
        ("base.angular", in_base((0.6, 0.7, -0.8))),
        ("gravity", in_base((0.0, 0.0, -1.0))),
        ("base.rpy", [0.1, -0.2, 1.5]),
        ("joints.position", [0.1, 0.2, 0.3]),
        ({"term": "joints.position", "offset": "home"}, [0.1, 0.2 - HOME, 0.3]),
        ({"term": "joints.position", "offset": {"sho*": 1, "*": 2}}, [-1.9, -0.8, -1.7]),
        ({"term": "joints.velocity", "scale": 100.0}, [1.0, 2.0, 3.0]),
        ({"term": "joints.velocity", "scale": (1, 2, 3)}, [0.01, 0.04, 0.09]),
        ({"term": "joints.velocity", "scale": {"elbow": 10.0, "*": 0.0}}, [0.0, 0.0, 0.3]),
        ({"term": "joints.effort", "clip": 1.5}, [1.0, 1.5, 1.5]),
        ({"term": "joints.effort", "joints": ("elbow", "*finger*", "turntable")}, [3.0, 4.0, 1.0]),
        ("last_action", [0.0, 0.0, 0.0]),
        ("commands", [0.5, 0.0, -0.25]),
        ("sensors.imu.angular_velocity_xyz", [1.0, 2.0, 3.0]),
    ],
)
def test_terms_are_as_formulas_say(term: Any, values: list[float], folder: Path) -> None:
    schedule: dict[str, Any] = {"commands": (0.5, 0, -0.25)} if term == "commands" else {}
    controller = opened(folder, identity(3), IMU, observation=(term,), rate=50.0, **schedule)
    assert efforts(controller.command(NOW)) == pytest.approx(values, abs=1e-12)


def test_gravity_is_that_of_the_world(folder: Path) -> None:
    world = World.model_validate({"gravity": (3.0, 0.0, -4.0)})
    controller = opened(folder, identity(3), world=world, observation=("gravity",))
    assert efforts(controller.command(NOW)) == pytest.approx(in_base((0.6, 0.0, -0.8)))


def test_single_numbers_are_joined_in_their_order(folder: Path) -> None:
    terms = ("time", "base.height", {"term": "phase.cos", "period": 0.8, "shift": 0.25})
    controller = opened(folder, identity(3), observation=terms)
    phase = 2 * math.pi * (0.3 / 0.8 + 0.25)
    assert efforts(controller.command(NOW)) == pytest.approx([0.3, 0.5, math.cos(phase)])


def test_commands_change_over_time(folder: Path) -> None:
    segments = ({"linear": 1, "for": 0.5}, {"lateral": 2, "for": 0.5})
    controller = opened(folder, identity(3), observation=("commands",), commands=segments)
    found = [efforts(controller.command(replace(NOW, time=time))) for time in (0.0, 0.49, 0.5, 1.0)]
    assert found == [[1, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 0]]


def test_the_output_is_clipped_scaled_and_moved(folder: Path) -> None:
    action = {"joints": "position", "scale": (0.1, 0.2, 0.3), "offset": "home", "clip": 0.25}
    terms = ({"term": "joints.position", "offset": 0},)
    answer = opened(folder, identity(3), observation=terms, action=action).command(NOW)
    assert isinstance(answer, JointTargets)
    assert list(answer.position.values()) == pytest.approx([0.01, HOME + 0.04, 0.075])
    assert answer.effort == answer.velocity == {}


def test_positions_are_relative_to_the_offset_of_a_position_action(folder: Path) -> None:
    action = {"joints": "position", "offset": "home"}
    answer = opened(folder, identity(3), observation=("joints.position",), action=action).command(NOW)
    assert isinstance(answer, JointTargets)
    assert list(answer.position.values()) == pytest.approx([0.1, 0.2, 0.3])  # what was subtracted is added


def test_the_last_action_is_that_of_the_network_after_clip(folder: Path) -> None:
    # The output is the effort of a joint and the last action: it grows by 1 at each tick.
    network = linear([[1, 0, 0], [0, 1, 0], [0, 0, 1]], [1, 1, 1], DOUBLE)
    action = {"joints": "effort", "scale": 2, "clip": 2.5}
    controller = opened(folder, network, observation=("last_action",), action=action)
    assert [efforts(controller.command(NOW))[0] for _ in range(4)] == [2.0, 4.0, 5.0, 5.0]


@pytest.mark.parametrize(
    ("history", "expected"),
    [
        ({"frames": 3}, [[0, 9], [0, 9], [0, 9]]),
        ({"frames": 3, "start": "zeros"}, [[0, 0], [0, 0], [0, 9]]),
        ({"frames": 3, "order": "term"}, [[0, 0], [0, 9], [9, 9]]),
    ],
)
def test_history_is_oldest_first(history: dict[str, Any], expected: list[list[int]], folder: Path) -> None:
    flat = [value for pair in expected for value in pair]
    for place, value in enumerate(flat):
        weights = [[float(row == place)] for row in range(6)]
        keys: dict[str, Any] = {"order": ("elbow",), "history": history, "action": {"joints": "velocity"}}
        terms = ("time", {"term": "base.height", "scale": 18})
        controller = opened(folder, linear(weights, [0], DOUBLE), observation=terms, **keys)
        answer = controller.command(replace(NOW, time=0.0))
        assert isinstance(answer, JointTargets)
        assert answer.velocity["elbow"] == pytest.approx(min(3.0, value)), place  # clipped to the limit of the model


def test_a_recurrent_network_remembers(folder: Path) -> None:
    keys: dict[str, Any] = {"state": {"h_in": "h_out"}, "order": ("turntable", "shoulder")}
    keys["observation"] = ("time", "base.height")
    controller = opened(folder, recurrent(), **keys)
    found = [controller.command(NOW) for _ in range(3)]
    assert [list(each.effort.values()) for each in found if isinstance(each, JointTargets)] == [
        pytest.approx([0.3 * count, 0.5 * count]) for count in (1, 2, 3)
    ]


def test_several_inputs_have_terms_by_name(folder: Path) -> None:
    nodes = [node("Sub", ["a", "b"], ["y"])]
    network = model(nodes, {"b": ("batch", 1), "a": (1, 1)}, {"y": (1, 1)}, kind=DOUBLE)
    inputs = {"a": ("base.height",), "b": ("time",)}
    controller = opened(folder, network, inputs=inputs, order=("elbow",))
    answer = controller.command(NOW)
    assert isinstance(answer, JointTargets)
    assert answer.effort == pytest.approx({"elbow": 0.2})


def test_soft_motors_act_at_every_physics_step(folder: Path) -> None:
    action = {"joints": "position", "offset": "home", "stiffness": 10, "damping": {"elbow": 2, "*": 0}}
    network = linear([[1, 1, 1]], [0, 0, 0], DOUBLE)
    controller = opened(folder, network, observation=("time",), rate=120.0, action=action)
    spring = [10 * (0.3 - 0.1), 10 * (HOME + 0.3 - 0.2), 10 * (0.3 - 0.3) - 2 * 0.03]
    assert efforts(controller.command(NOW)) == pytest.approx(spring)
    # 240 Hz: the network runs at every other step.
    assert efforts(controller.command(replace(NOW, time=0.5))) == pytest.approx(spring)
    assert efforts(controller.command(replace(NOW, time=0.4)))[0] == pytest.approx(3.0)
    spec = PolicyCommands.model_validate({"policy": "a", "observation": ("time",), "rate": 120.0, "action": action})
    assert spec.tick_rate(240.0) == 240.0
    spec = PolicyCommands.model_validate({"policy": "a", "rate": 120.0, "action": {"joints": "position"}})
    assert spec.tick_rate(240.0) == 120.0


@pytest.mark.parametrize("bias", [math.nan, math.inf])
def test_an_output_that_is_not_finite_is_an_error(bias: float, folder: Path) -> None:
    controller = opened(folder, linear([[1, 1, 1]], [0, bias, 0]), observation=("time",))
    with pytest.raises(ScriptError) as raised:
        controller.command(NOW)
    assert str(raised.value) == f"the network returned {bias} for joint 'shoulder'; its inputs are finite, at most 0.3"


@pytest.mark.parametrize("bias", [math.nan, -math.inf, 0.0])
@pytest.mark.parametrize("is_output", [False, True])
@pytest.mark.parametrize(
    ("nodes", "kind"),
    [
        ([node("ArgMax", ["scores"], ["y"], integer("axis", 1))], INT64),
        ([node("ArgMin", ["scores"], ["low"], integer("axis", 1)), node("Identity", ["low"], ["y"])], INT64),
        ([node("Greater", ["scores", "b"], ["g"]), node("Cast", ["g"], ["c"], integer("to", FLOAT))], FLOAT),
        ([node("ReduceMax", ["scores"], ["y"], integer("keepdims", 0))], FLOAT),
    ],
)
def test_nan_inside_a_network_that_picks_its_action_is_an_error(
    nodes: list[bytes], kind: int, is_output: bool, bias: float, folder: Path
) -> None:
    if kind == FLOAT and len(nodes) > 1:
        nodes = [*nodes, node("ReduceSum", ["c"], ["y"], integer("keepdims", 0))]
    outputs: dict[str, Any] = {"y": None, **({"scores": (1, 3)} if is_output else {})}
    network = model(
        [node("Gemm", ["x", "w", "b"], ["scores"]), *nodes],
        {"x": (1, 1)},
        outputs,
        [tensor("w", (1, 3), [0, 0, 0]), tensor("b", (3,), [0, bias, 1])],
        kinds={"y": kind},
    )
    action = {"joints": "effort", "choices": tuple((each, 0, 0) for each in range(3))}
    controller = opened(folder, network, observation=("time",), action=action, output="y" if is_output else None)
    if not math.isnan(bias):
        assert controller.command(NOW)
        return
    with pytest.raises(ScriptError) as raised:
        controller.command(NOW)
    assert "returned nan for its inner value 'scores'" in str(raised.value)


def picking(where: str, *, inside: bool) -> bytes:
    """Return a network whose ArgMax is in a subgraph or a function; it reads a value from outside, or of its own."""
    score = node("Gemm", ["x", "w", "b"], ["scores"])
    pick = [*([score] if inside else []), node("ArgMax", ["scores"], ["i"], integer("axis", 1))]
    weights = [tensor("w", (1, 3), [0, 0, 0]), tensor("b", (3,), [0, math.nan, 1]), tensor("yes", (), [1], BOOL)]
    rest = b""
    if where == "If":
        branches = (subgraph(name, pick, {}, {"i": INT64}) for name in ("then_branch", "else_branch"))
        outer = [node("If", ["yes"], ["y"], b"".join(branches))]
    elif where == "Loop":
        weights += [tensor("n", (), [1], INT64), tensor("v", (), [0], INT64)]
        body = [node("Identity", ["go"], ["more"]), *pick]
        body_of = subgraph("body", body, {"k": INT64, "go": BOOL, "u": INT64}, {"more": BOOL, "i": INT64})
        outer = [node("Loop", ["n", "yes", "v"], ["y"], body_of)]
    elif where == "Scan":
        weights += [tensor("steps", (1,), [0])]
        body_of = subgraph("body", pick, {"step": FLOAT}, {"i": INT64})
        outer = [node("Scan", ["steps"], ["y"], body_of + integer("num_scan_inputs", 1))]
    else:
        reads = ["x", "w", "b"] if inside else ["scores"]
        outer = [node("Pick", reads, ["y"], part(7, "own"))]
        names = b"".join((*(part(4, each) for each in reads), part(5, "i"), *(part(7, each) for each in pick)))
        rest = part(25, part(1, "Pick") + names + part(9, number(2, 17)) + part(10, "own"))
        rest += part(8, part(1, "own") + number(2, 1))
    nodes = [*([] if inside else [score]), *outer]
    return model(nodes, {"x": (1, 1)}, {"y": None}, weights, kinds={"y": INT64}, rest=rest)


@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.parametrize("where", ["If", "Loop", "Scan", "function"])
def test_nan_before_a_choice_in_a_subgraph_is_an_error_or_has_a_note(where: str, inside: bool, folder: Path) -> None:
    action = {"joints": "effort", "choices": tuple((each, 0, 0) for each in range(3))}
    controller = opened(folder, picking(where, inside=inside), observation=("time",), action=action)
    if inside or where == "function":
        assert controller.command(NOW)
        assert "has ArgMax inside a subgraph or a function of the network" in "".join(controller.notes)
        return
    assert not controller.notes
    with pytest.raises(ScriptError, match="returned nan for its inner value 'scores'"):
        controller.command(NOW)


@pytest.mark.parametrize(
    ("action", "what"),
    [
        ({"joints": "position", "scale": 1e308}, "target position"),
        ({"joints": "velocity", "scale": 1e308}, "target velocity"),
        ({"joints": "effort", "scale": 1e308}, "target effort"),
        ({"joints": "position", "stiffness": 1e308, "damping": 0}, "effort"),
        ({"joints": "velocity", "damping": 1e308}, "effort"),
    ],
)
def test_a_target_that_is_not_finite_is_an_error(action: dict[str, Any], what: str, folder: Path) -> None:
    controller = opened(folder, linear([[1, 1, 1]], [0, 10, 0]), observation=("time",), action=action)
    with pytest.raises(ScriptError, match=f"^the {what} of joint 'shoulder' is inf: the network's output is finite"):
        controller.command(NOW)


@pytest.mark.parametrize("history", [None, {"frames": 2, "order": "term"}])
def test_a_term_too_large_for_the_type_of_the_input_is_named(history: dict[str, Any] | None, folder: Path) -> None:
    width = 4 if history is None else 8
    network = linear([[0, 0, 0]] * width, [0, 0, 0])
    observation = ("gravity", {"term": "time", "scale": 1e300})
    controller = opened(folder, network, observation=observation, history=history)
    with pytest.raises(ScriptError, match=r"^the term 'time' of the observation has the value 3e\+299, which is too"):
        controller.command(NOW)


def test_soft_velocity_motors_brake_towards_their_target(folder: Path) -> None:
    action = {"joints": "velocity", "damping": (2, 3, 4)}
    controller = opened(folder, linear([[1, 1, 1]], [0, 0, 0], DOUBLE), observation=("time",), action=action)
    speeds = [NOW.joints[name].velocity for name in ("turntable", "shoulder", "elbow")]
    expected = [gain * (0.3 - speed) for gain, speed in zip((2, 3, 4), speeds, strict=True)]
    assert efforts(controller.command(NOW)) == pytest.approx(expected)


def test_a_term_that_is_not_finite_is_named(folder: Path) -> None:
    controller = opened(folder, identity(3), observation=("joints.velocity",))
    joints = {**NOW.joints, "elbow": JointState(0.0, math.inf, 0.0)}
    with pytest.raises(ScriptError, match=r"the term 'joints\.velocity' of the observation has a value that is not f"):
        controller.command(replace(NOW, joints=joints))


def test_without_onnxruntime_the_way_to_install_it_is_told(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "onnxruntime", None)
    with pytest.raises(SourceProblem, match=r"pip install 'sim-action\[policy\]', or in a workflow set the input"):
        opened(folder, identity(3), observation=("gravity",))


GRAVITY = "observation: [gravity]"
ALL = "order: [turntable, shoulder, elbow]"
EFFORT = "action: {joints: effort}"
TEXTS = model([node("Identity", ["x"], ["y"])], {"x": (3,)}, {"y": (3,)}, kind=TEXT)


REFUSED_KEYS = [
    (
        "observation: [base.angular, gravity, joints.position]",
        "the network's input 'obs' takes 1 x 3, and the observation gives 9 numbers: base.angular 3, gravity 3",
    ),
    ("observation: [gravity], history: {frames: 4}", "the observation gives 12 numbers: gravity 3 x 4"),
    ("observation: [gravty]", "observation.0: unknown term 'gravty'; did you mean 'gra"),
    ("observation: [{term: gravity, scal: 2}]", "unknown key; did you mean 'scale'?"),
    ("observation: [{term: gravity, scale: [1, 2]}]", "has 2 numbers, and 'gravity' has 3"),
    ("observation: [{term: gravity, scale: {a: 1}}]", "'gravity' is not a term of joi"),
    ("observation: [{term: gravity, scale: a}]", "expected a number, a list with a nu"),
    ("observation: [commands]", "add 'commands: [vx, vy, wz]' for the term 'commands'"),
    ("observation: [gravity], commands: [1, 0, 0]", "no term reads them"),
    ("observation: [commands], commands: [1, 0]", "expected [vx, vy, wz] or a list of"),
    ("observation: [phase.sin]", "'phase.sin' needs a 'period'"),
    ("observation: [sensors.imu.x]", "the scenario has no sensor 'imu' (allowed: none)"),
    ("inputs: {ob: [gravity]}", "the network has no input 'ob'; did you mean 'obs'?"),
    ("inputs: {}, observation: []", "give the terms in 'observation' or 'inputs', or give 'pictures'"),
    ("observation: [gravity], output: action", "no output 'action'; did you mean 'actions'?"),
    ("observation: [gravity, {term: time, clip: 0}]", "must be greater than 0"),
    ("observation: gravity", "expected a list, found 'gravity'; write [gravity]"),
]
REFUSED_ACTIONS = [
    ("joints: effort, scale: .nan", "expected a number, a list with a nu"),
    ("joints: torque", "expected 'position', 'velocity' or 'eff"),
    ("joints: effort, scale: [1, 2]", "has 2 numbers for 3 joints (turntable, shoulder, elbow)"),
    ("joints: position, offset: {shoulder: 1}", "action.offset: joint 'turntable' has no value; add it, or a pattern"),
    (
        "joints: position, offset: {elbw: 1, '*': 0}",
        "action.offset.elbw: no joint of the policy matches 'elbw'; did you mean 'elbow'?",
    ),
    ("joints: position, offset: hom", "expected 'home', a number, a list"),
    ("joints: position, stiffness: 3", "a target position needs both of 'stiffness' and 'damping'"),
    (
        "joints: position, stiffness: {'*': -5}, damping: 1",
        "action.stiffness: must be at least 0, found -5: the joint would move away from its target",
    ),
    ("joints: velocity, damping: [1, -1, 0]", "action.damping: must be at least 0, found -1"),
    ("joints: effort, damping: 3", "an effort is applied directly"),
]


@pytest.mark.parametrize(
    ("network", "keys", "problem"),
    [
        *((identity(3), f"{keys}, {ALL}, {EFFORT}", problem) for keys, problem in REFUSED_KEYS),
        *((identity(3), f"{GRAVITY}, {ALL}, action: {{{keys}}}", problem) for keys, problem in REFUSED_ACTIONS),
        (identity(3), f"{GRAVITY}, {ALL}, {EFFORT}, rate: null", "commands.policy.rate: "),
        (identity(3), f"{GRAVITY}, {EFFORT}", "action: the network's output 'actions' has 3 numbers, for 4 joints: tu"),
        (identity(3), f"{GRAVITY}, order: [elbo], {EFFORT}", "order.0: the model has no moving joint 'el"),
        (identity(3), f"{GRAVITY}, order: ['right_finger*'], {EFFORT}", "none of these joints has a moto"),
        (identity(3), f"{GRAVITY}, order: [elbow], {EFFORT}", "'actions' has 3 numbers, for 1 joint: elbow; name th"),
        (
            identity(1),
            f"observation: [time], order: [right_finger_joint], {EFFORT}",
            "order.0: joint 'right_finger_joint' cannot be commanded: it mimics 'left_finger_joint'",
        ),
        (identity(3), f"{GRAVITY}, order: [elbow, elbow], {EFFORT}", "order.1: joint 'elbow' stands twice; remove one"),
        (
            identity(3),
            f"{GRAVITY}, {ALL}, latency: 10 ms, action: {{joints: velocity, damping: 3}}",
            "cannot be combined with latency, jitter or dropouts",
        ),
        (identity(3), f"{ALL}, {EFFORT}", "give the terms in 'observation' or 'inputs', or give 'pictures'"),
        (recurrent(), f"{GRAVITY}, {ALL}, {EFFORT}", "is for one input, and the network has 'obs' (1 x 2"),
        (recurrent(), f"inputs: {{obs: [gravity]}}, output: actions, {ALL}, {EFFORT}", "the network also takes 'h_in'"),
        (
            recurrent(),
            f"{GRAVITY}, state: {{h_in: h_ot}}, {ALL}, {EFFORT}",
            "state.h_in: the network has no output 'h_ot'; did you mean 'h_out'?",
        ),
        (recurrent(), f"inputs: {{obs: [gravity], h_in: [time]}}, {ALL}, {EFFORT}", "has several outputs; add 'output"),
        (TEXTS, f"{GRAVITY}, {ALL}, {EFFORT}", "a.onnx: input 'x' is of text, and not of numbers"),
        (b"no network", f"{GRAVITY}, {ALL}, {EFFORT}", "3:21: commands.policy.file: a.onnx is refused by"),
        (None, f"{GRAVITY}, {ALL}, {EFFORT}", "3:21: commands.policy.file: 'a.onnx' does not exist"),
        (identity(3), f"{GRAVITY}, {ALL}, {EFFORT}, rate: 7 kHz", "policy.rate: 7000 Hz does not divide"),
        (identity(3), f"{GRAVITY}, {ALL}", "the key 'action' is missing"),
    ],
    ids=lambda value: "" if isinstance(value, bytes | None) else None,
)
def test_what_does_not_fit_is_told_on_its_line(network: bytes | None, keys: str, problem: str, folder: Path) -> None:
    if network is not None:
        (folder / "a.onnx").write_bytes(network)
    found = told(folder, text(keys))
    assert any(problem in each for each in found), found
    assert all(each.startswith("3:") for each in found), found


def test_a_joint_or_gravity_that_is_not_there_has_one_problem(folder: Path) -> None:
    (folder / "a.onnx").write_bytes(identity(3))
    (found,) = told(folder, text(f"{GRAVITY}, order: ['k*'], {EFFORT}"))
    assert "no moving joint" in found
    (found,) = told(folder, text(f"{GRAVITY}, {ALL}, {EFFORT}") + "world: {gravity: 0}\n")
    assert "observation.0.term: the world has no gravity; change world.gravity" in found
