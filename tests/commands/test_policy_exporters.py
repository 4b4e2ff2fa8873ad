"""The table of exporters in docs/scenario/policies.md: a network in the form of each commands the arm."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_action.commands import ClosedLoop
from sim_action.commands.policy import PolicyCommands
from sim_action.core.errors import ScriptError
from sim_action.core.geometry import Pose, Twist
from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from sim_action.scenario.loading import load_scenario
from sim_action.sensors.camera import Camera
from sim_action.state.command import JointTargets
from sim_action.state.observation import JointState, Observation
from sim_action.state.readings import CameraImage
from sim_action.world import Physics, World
from sim_action.world.scene import Fitting, Scene
from tests.onnx_files import (
    BOOL,
    FLOAT,
    HALF,
    INT32,
    INT64,
    UINT8,
    external,
    in_process,
    integer,
    linear,
    model,
    node,
    part,
    recurrent,
    tensor,
)

ARM = Path(__file__).parents[2] / "examples/commands/arm.urdf"
IMAGE = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3) * 10
CAMERA = Fitting("front", "camera", "base_link", 30.0, keys=Camera(width=3, height=2))
NOW = Observation(
    time=0.0,
    pose=Pose(),
    twist=Twist((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    joints={"shoulder": JointState(0.2, 0.0, 0.0), "elbow": JointState(0.3, 0.0, 0.0)},
    sensors={"front": CameraImage(0.0, IMAGE, np.ones((2, 3), np.float32))},
)
EFFORT, POSITION = {"joints": "effort"}, {"joints": "position"}
PAIR: dict[str, Any] = {"observation": ("joints.position",), "action": EFFORT}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    in_process(monkeypatch)
    (tmp_path / "arm.urdf").write_text(ARM.read_text())
    return tmp_path


def loaded(folder: Path, network: bytes, keys: dict[str, Any]) -> tuple[PolicyCommands, Scene, list[str]]:
    """Return a policy for shoulder and elbow, and its problems, each with the key."""
    (folder / "a.onnx").write_bytes(network)
    workspace = Workspace(folder, folder)
    robot = Robot.model_validate({"model": "arm.urdf", "base": "fixed", "joints": {"shoulder": "10 deg"}})
    scene = Scene(robot, load_model(robot, workspace), World(), Physics(), workspace, sensors=(CAMERA,))
    order = {} if "joint_names" in str(network) else {"order": ("shoulder", "elbow")}
    spec = PolicyCommands.model_validate({"policy": "a.onnx", "rate": 60.0, **order, **keys}).completed(workspace)
    problems = [*spec.problems(workspace), *spec.model_problems(scene)]
    return spec, scene, [f"{'.'.join(map(str, path))}: {text}" for path, text in problems]


def commanded(folder: Path, network: bytes, keys: dict[str, Any], ticks: int = 1) -> list[float]:
    """Return the targets or efforts of shoulder and elbow after some ticks."""
    spec, scene, problems = loaded(folder, network, keys)
    assert problems == []
    controller = spec.open(scene)
    assert isinstance(controller, ClosedLoop)
    answers = [controller.command(replace(NOW, time=tick / 60)) for tick in range(ticks)]
    assert isinstance(answers[-1], JointTargets)
    return list((answers[-1].effort or answers[-1].position).values())


NEGATIVE = {"term": "joints.position", "scale": -1}
IDENTITY = [1, 0, 0, 1]
W = tensor("w", (2, 2), IDENTITY)
MATMUL = node("MatMul", ["obs", "w"], ["actions"])


def with_(kinds: dict[str, int], nodes: list[bytes], **inputs: Any) -> bytes:
    outputs: dict[str, Any] = {"actions": (1, 2), **{name: ("n",) for name in kinds if name not in inputs}}
    return model([MATMUL, *nodes], {"obs": (1, 2), **inputs}, outputs, [W], kinds=kinds)


HALF_W = tensor("w", (2, 2), IDENTITY, HALF)
FREE_STEPS = model(
    [node("ReduceSum", ["obs", "axes"], ["s"]), node("MatMul", ["s", "w"], ["y"]),
     node("Reshape", ["y", "flat"], ["actions"])],
    {"obs": ("batch", "steps", 2)}, {"actions": ("batch", 2)},
    [W, tensor("axes", (1,), [1], INT64), tensor("flat", (2,), [1, 2], INT64)],
)  # fmt: skip
SEQUENCE = part(1, "map") + part(2, part(4, part(1, part(1, b"\x08\x01"))))


ROWS: dict[str, tuple[bytes, dict[str, Any], list[float]]] = {
    "plain": (model([MATMUL], {"obs": (1, 2)}, {"actions": (1, 2)}, [W]), PAIR, [0.2, 0.3]),
    "weights in another file": (
        model([MATMUL], {"obs": (1, 2)}, {"actions": (1, 2)}, [external("w", (2, 2), "a.onnx.data")]),
        PAIR,
        [0.2, 0.3],
    ),
    "free batch": (model([MATMUL], {"obs": ("N", 2)}, {"actions": ("N", 2)}, [W]), PAIR, [0.2, 0.3]),
    "no shape": (model([MATMUL], {"obs": None}, {"actions": None}, [W]), PAIR, [0.2, 0.3]),
    "batch of the training": (model([MATMUL], {"obs": (4, 2)}, {"actions": (4, 2)}, [W]), PAIR, [0.2, 0.3]),
    "wrong batch of the output": (model([MATMUL], {"obs": ("N", 2)}, {"actions": (4, 2)}, [W]), PAIR, [0.2, 0.3]),
    "free number of steps": (FREE_STEPS, {**PAIR, "history": {"frames": 3}}, [0.6, 0.9]),
    "recurrent": (recurrent(), {**PAIR, "state": {"h_in": "h_out"}, "output": "actions"}, [0.2, 0.3]),
    "constants": (
        with_({"seq_lens": INT32, "is_training": BOOL, "a": INT32, "b": BOOL},
              [node("Identity", ["seq_lens"], ["a"]), node("Identity", ["is_training"], ["b"])],
              seq_lens=("n",), is_training=("n",)),
        {**PAIR, "constants": {"seq_lens": 1, "is_training": False}, "output": "actions"},
        [0.2, 0.3],
    ),
    "other outputs": (
        model([MATMUL, node("SequenceConstruct", ["obs", "obs"], ["map"])], {"obs": (1, 2)}, {"actions": (1, 2)}, [W],
              more_outputs=[SEQUENCE]),
        {**PAIR, "output": "actions"},
        [0.2, 0.3],
    ),
    "float16": (model([MATMUL], {"obs": (1, 2)}, {"actions": (1, 2)}, [HALF_W], HALF), PAIR, [0.2, 0.3]),
    "scores": (
        linear([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]], [0.1, 0.0, 0.0]),
        {**PAIR, "action": {**EFFORT, "choices": ((1, 0), (2, -2), (0, 1))}},
        [2.0, -2.0],
    ),
    "index": (
        model([node("MatMul", ["obs", "w"], ["y"]), node("ArgMax", ["y"], ["actions"], integer("axis", 1))],
              {"obs": (1, 2)}, {"actions": (1, 1)}, [W], kinds={"actions": INT64}),
        {**PAIR, "action": {**EFFORT, "choices": ((1, 0), (2, -2))}},
        [2.0, -2.0],
    ),
    "chunk": (
        model([node("Gemm", ["obs", "zero", "chunk"], ["y"]), node("Reshape", ["y", "shape"], ["actions"])],
              {"obs": (1, 2)}, {"actions": (1, 3, 2)},
              [tensor("zero", (2, 6), [0] * 12), tensor("chunk", (6,), range(6)),
               tensor("shape", (3,), [1, 3, 2], INT64)]),
        {**PAIR, "action": {**EFFORT, "execute": 2}},
        [0.0, 1.0],
    ),
    "picture as floats": (
        model([node("ReduceSum", ["image", "axes"], ["sums"], integer("keepdims", 0)),
               node("MatMul", ["sums", "v"], ["actions"])],
              {"image": (1, 3, 2, 3)}, {"actions": (1, 2)},
              [tensor("axes", (2,), [2, 3], INT64), tensor("v", (3, 2), [1, 0, 0, 1, 0, 0])]),
        {"pictures": {"image": {"camera": "front"}}, "action": EFFORT},
        [float(IMAGE[..., 0].sum()) / 255, float(IMAGE[..., 1].sum()) / 255],
    ),
    "picture as bytes": (
        model([node("Cast", ["image"], ["f"], integer("to", FLOAT)), node("ReduceSum", ["f", "axes"], ["s"]),
               node("MatMul", ["s", "v"], ["actions"])],
              {"image": ("N", "H", "W", 3)}, {"actions": ("N", 2)},
              [tensor("axes", (2,), [1, 2], INT64), tensor("v", (3, 2), [0.01, 0, 0, 0.01, 0, 0])],
              kinds={"image": UINT8}),
        {"pictures": {"image": {"camera": "front", "layout": "nhwc"}}, "action": EFFORT},
        [float(IMAGE[..., 0].sum()) / 100, float(IMAGE[..., 1].sum()) / 100],
    ),
}  # fmt: skip


@pytest.mark.parametrize("row", ROWS)
def test_a_network_of_each_form_commands_the_joints(row: str, folder: Path) -> None:
    network, keys, expected = ROWS[row]
    (folder / "a.onnx.data").write_bytes(np.array(IDENTITY, np.float32).tobytes())
    assert commanded(folder, network, keys) == pytest.approx(expected, abs=2e-4)


def test_a_chunk_is_executed_and_then_the_network_is_asked_again(folder: Path) -> None:
    network = ROWS["chunk"][0]
    keys = {**PAIR, "action": {**EFFORT, "execute": 2}}
    assert [commanded(folder, network, keys, ticks)[0] for ticks in (1, 2, 3, 4)] == [0, 2, 0, 2]
    # As ACT: the oldest of the predictions for a tick has the greatest weight.
    keys = {**PAIR, "action": {**EFFORT, "ensemble": 0.5}}
    weights = [1, math.exp(-0.5), math.exp(-1)]
    full = (4 * weights[0] + 2 * weights[1]) / sum(weights)
    expected = [0.0, (2 * weights[0] + 0 * weights[1]) / sum(weights[:2]), full, full]
    assert [commanded(folder, network, keys, ticks)[0] for ticks in (1, 2, 3, 4)] == pytest.approx(expected)


TEXTS = {
    "joint_names": "elbow,shoulder",
    "default_joint_pos": "0.100,0.200",
    "action_scale": "0.500,0.250",
    "joint_stiffness": "20.000,30.000",
    "joint_damping": "1.000,2.000",
    "observation_names": "joint_pos,actions",
}

# As mjlab has it for a gripper: 'finger' follows another joint and has no motor.
WITH_A_FINGER = {"joint_names": "elbow,finger,shoulder", "default_joint_pos": "0.100,9.000,0.200"}
MOTORS = {"joint_stiffness": "1.000,1.000", "joint_damping": "-0.000,-0.000"}


def stating(**texts: str) -> bytes:
    return model([node("MatMul", ["obs", "w"], ["actions"])], {"obs": (1, 4)}, {"actions": (1, 2)},
                 [tensor("w", (4, 2), [1, 0, 0, 1, 0, 0, 0, 0])], metadata={**TEXTS, **texts})  # fmt: skip


def test_the_texts_of_a_network_fill_the_keys(folder: Path) -> None:
    spec, _, problems = loaded(folder, stating(), {})
    assert problems == []
    assert spec.order == ("elbow", "shoulder")
    assert spec.action is not None
    assert (spec.action.offset, spec.action.scale) == ((0.1, 0.2), (0.5, 0.25))
    assert [term.term for term in spec.observation] == ["joints.position", "last_action"]
    assert spec.tick_rate(240.0) == 240.0  # soft motors
    # A spring to 0.1 + 0.5 * (0.3 - 0.1) from 0.3, and to 0.2 + 0.25 * (0.2 - 0.2) from 0.2.
    assert commanded(folder, stating(), {}) == pytest.approx([20 * (0.2 - 0.3), 0], abs=1e-6)


def test_the_order_names_the_joints_that_have_a_motor(folder: Path) -> None:
    spec, _, problems = loaded(folder, stating(**WITH_A_FINGER), {"order": ("elbow", "shoulder")})
    assert problems == []
    assert spec.action is not None
    assert (spec.action.offset, spec.action.scale, spec.action.damping) == ((0.1, 0.2), (0.5, 0.25), (1, 2))


def test_a_scenario_need_not_repeat_what_the_network_states(folder: Path) -> None:
    (folder / "a.onnx").write_bytes(stating())
    text = "name: n\nrobot: {model: arm.urdf, base: fixed}\ncommands: {policy: {file: a.onnx}, rate: 60 Hz}\n"
    file = folder / "s.sim.yml"
    file.write_text(f"{text}expect: [{{joint: {{name: elbow, at_most: 1}}}}]\ntime_limit: 1 s\n")
    (source,) = load_scenario(file).scenario.commands
    assert isinstance(source, PolicyCommands)
    assert source.order == ("elbow", "shoulder")


@pytest.mark.parametrize(
    ("scale", "clip"),
    [("[0.500, 2.000],0.5", "[-inf, inf],[-3.0, 3.0]"), ("0.500;2.000,0.500", "-inf;inf,-3.000;3.000")],  # mjlab 1.6
)
def test_terms_have_the_scale_clip_and_history_that_the_network_states(folder: Path, scale: str, clip: str) -> None:
    texts = {"observation_terms_scale": scale, "observation_terms_clip": clip}
    spec, _, problems = loaded(folder, stating(**texts, observation_terms_history_length="1.000,0.000"), {})
    assert problems == []
    assert [(term.scale, term.clip, term.frames) for term in spec.observation] == [((0.5, 2.0), None, 1), (0.5, 1.5, 1)]


@pytest.mark.parametrize(
    ("texts", "keys", "problem"),
    [
        ({}, {"order": ("shoulder", "elbow")}, "order: the network states the joints elbow, shoulder, and the"),
        (
            {},
            {"action": {**POSITION, "scale": 0.5}},
            "action.scale: the network states 'action_scale' 0.25 for joint 'shoulder', and the scenario 0.5",
        ),
        (
            {},
            {"action": {**POSITION, "offset": "home"}},
            "action.offset: the network states 'default_joint_pos' 0.1 for joint 'elbow', and the scenario 0",
        ),
        ({}, {"action": {**POSITION, "stiffness": None, "damping": None}}, None),
        ({}, {"action": {**POSITION, "scale": (0.5002, 0.25)}}, None),
        (
            {},
            {"observation": ("joints.velocity", "last_action")},
            "observation.0: the network states 'joints.position', and the scenario 'joints.velocity' for 'joint_pos'",
        ),
        (
            {"observation_history_lengths": "1,2"},
            {"observation": ("joints.position", "last_action")},
            "observation.1: the network states 'frames' 2, and the scenario 1 for 'actions'",
        ),
        ({"observation_names": "joint_pos,motion_anchor_pos_b"}, {}, "for which there is no term"),
        (
            {"observation_terms_clip": "-1.000;3.000,-inf;inf"},
            {},
            "policy: a.onnx states the clip -1 to 3 for 'joint_pos'; a term is clipped to -X to X",
        ),
        (
            {"observation_terms_scale": "0.500;2.000,1.000", "observation_terms_clip": "-3.000;3.000,-inf;inf"},
            {},
            "policy: a.onnx states one clip and several scales for 'joint_pos'; a term has one clip after them",
        ),
        (
            {"observation_terms_scale": "0.500,1.000", "observation_terms_clip": "-3.000;3.000,-inf;inf"},
            {"observation": ({"term": "joints.position", "scale": 0.5, "clip": 3}, "last_action")},
            "observation.0: the network states 'clip' 1.5 after its scale, and the scenario 3.0 for 'joint_pos'",
        ),
        (WITH_A_FINGER, {}, "states 2 numbers as 'action_scale' for 3 joints; name the joints that have a motor in 'o"),
        ({"action_scale": "1,2,3"}, {}, "policy: a.onnx states 3 numbers as 'action_scale' for 2 joints"),
        # mjlab 1.6: motors, and a position and a velocity actuator for each joint
        (MOTORS, {}, "action: the network states an actuator of joint 'elbow', not the gains of its training; give 's"),
        (
            {"joint_stiffness": "20.000,2.000", "joint_damping": "1.000,2.000"},
            {},
            "action: the network states an actuator of joint 'shoulder'",
        ),
        (MOTORS, {"action": {**POSITION, "stiffness": 20, "damping": 1}}, None),
        ({"joint_damping": "1,soft"}, {}, "policy: a.onnx states 'soft' in 'joint_damping', which is not a number"),
    ],
)
def test_a_contradiction_names_both_values(
    texts: dict[str, str], keys: dict[str, Any], problem: str | None, folder: Path
) -> None:
    _, _, problems = loaded(folder, stating(**texts), keys)
    assert not problems if problem is None else any(problem in each for each in problems), problems


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ({"action": {**EFFORT, "execute": 4}}, "action.execute: the network's output 'actions' has 6 numbers, and not"),
        ({"action": EFFORT}, "action: the network's output 'actions' has 6 numbers, for 2 joints: shoulder, elbow; "),
        ({"action": {**EFFORT, "choices": ((1, 0), (0, 1))}}, "has 6 numbers, for 2 choices: give a row for each"),
        ({"action": {**EFFORT, "choices": (1, 0)}}, "action.choices.0: has 1 number for 2 joints (shoulder, elbow)"),
        ({"action": {**EFFORT, "execute": 2, "ensemble": 0.1}}, "'choices', 'execute' and 'ensemble' cannot be"),
        ({"action": EFFORT, "pictures": {"obs": {"camera": "frnt"}}}, "has no camera 'frnt'; did you mean 'front'?"),
        ({"action": EFFORT, "constants": {"ob": 1}}, "the network has no input 'ob'; did you mean 'obs'?"),
    ],
)
def test_what_does_not_fit_is_a_problem(keys: dict[str, Any], problem: str, folder: Path) -> None:
    _, _, problems = loaded(folder, ROWS["chunk"][0], {"observation": ("joints.position",), **keys})
    assert any(problem in each for each in problems), problems


@pytest.mark.parametrize(
    ("network", "keys", "message"),
    [
        (
            model([node("Log", ["obs"], ["actions"])], {"obs": (1, 2)}, {"actions": (1, 2)}),
            {**PAIR, "action": {**EFFORT, "choices": ((1, 0), (0, 1))}, "observation": (NEGATIVE,)},
            "the network returned nan for choice 0; its inputs are finite, at most 0.3",
        ),
        (
            with_({"h": FLOAT, "g": FLOAT}, [node("Log", ["h"], ["g"])], h=(1,)),
            {**PAIR, "state": {"h": "g"}, "output": "actions"},
            "the network returned -inf for the state 'g'; its inputs are finite, at most 0.3",
        ),
    ],
)
def test_what_is_not_finite_is_no_action(network: bytes, keys: dict[str, Any], message: str, folder: Path) -> None:
    with pytest.raises(ScriptError) as raised:
        commanded(folder, network, keys)
    assert str(raised.value) == message
