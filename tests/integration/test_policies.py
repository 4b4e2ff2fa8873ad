"""Networks that drive robots in whole runs: the same law as a script, repeated, refused, or behind a server."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

from sim_action.engines import installed
from tests.integration.conftest import fresh_sim_action, outcomes, sim_action, write
from tests.onnx_files import DOUBLE, balance, linear

ROOT = Path(__file__).parents[2]

SCENARIO = """\
name: {name}
robot: {{model: arm.urdf, base: fixed, joints: {{shoulder: 10 deg, elbow: -15 deg}}}}
commands:
  {commands}
expect: [{{joint: {{name: shoulder, near: 0 deg, tolerance: 2 deg}}, before: 0.4 s}}]
duration: 0.5 s
time_limit: 0.5 s
"""
POLICY = (
    "policy: {file: pd.onnx, observation: [joints.position, joints.velocity], order: [shoulder, elbow],\n"
    "    action: {joints: effort}, rate: 120 Hz}"
)
LAW = """\
from sim_action import JointTargets

NAMES = ("shoulder", "elbow")


def control(observation, springs, dampers):
    efforts = {}
    for name, spring, damper in zip(NAMES, springs, dampers):
        state = observation.joints[name]
        efforts[name] = spring * state.position + damper * state.velocity
    return JointTargets(effort=efforts)
"""
SPRINGS, DAMPERS = (-64.0, -16.0), (-2.0, -0.25)  # powers of two: the products are exact, so both ways round once


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "arm.urdf").write_text((ROOT / "examples/commands/arm.urdf").read_text())
    rows = [[SPRINGS[0], 0], [0, SPRINGS[1]], [DAMPERS[0], 0], [0, DAMPERS[1]]]
    (tmp_path / "pd.onnx").write_bytes(linear(rows, [0, 0], DOUBLE))
    (tmp_path / "policy.sim.yml").write_text(SCENARIO.format(name="policy", commands=POLICY))
    return tmp_path


def test_a_network_is_the_same_as_its_law_in_python_each_time(folder: Path) -> None:
    (folder / "law.py").write_text(LAW)
    settings = f"{{springs: {list(SPRINGS)}, dampers: {list(DAMPERS)}}}"
    script = f"script: {{file: law.py, rate: 120 Hz, with: {settings}}}"
    (folder / "script.sim.yml").write_text(SCENARIO.format(name="script", commands=script))
    ran = sim_action(
        folder, "run", "--no-report", "--repeat", "2", "--backend", "all", "policy.sim.yml", "script.sim.yml"
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    found = outcomes(folder)
    assert len(found) == 2 * len(installed())
    assert all(outcome["status"] == "passed" for outcome in found), found
    digests = {(outcome["engine"], outcome["digest"]) for outcome in found}
    assert len(digests) == len(installed()), digests


LEVER = """<mujoco><worldbody><body name="lever" pos="0 0 1"><joint name="hinge" axis="0 0 1"/>
<geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0" mass="1"/></body></worldbody>
<actuator><motor name="hinge" joint="hinge" ctrlrange="-50 50"/></actuator></mujoco>"""


def test_a_chunked_network_follows_a_path_on_a_model_that_only_the_run_reads(folder: Path) -> None:
    """The path is 0.8 rad/s; each chunk has its next 8 targets."""
    (folder / "lever.xml").write_text(LEVER)
    rows = [0.8] * 8
    ramp = [0.02 * (step + 1) for step in range(8)]
    (folder / "ramp.onnx").write_bytes(linear([rows], ramp))
    policy = (
        "policy: {file: ramp.onnx, observation: [time], rate: 40 Hz,\n"
        "    action: {joints: position, execute: 8, stiffness: 20, damping: 1}}"
    )
    text = SCENARIO.format(name="chunks", commands=policy).replace("arm.urdf, base: fixed", "lever.xml, base: fixed")
    text = text.replace("joints: {shoulder: 10 deg, elbow: -15 deg}", "joints: {hinge: 0}")
    text = text.replace("duration: 0.5 s\ntime_limit: 0.5 s", "duration: 0.8 s\ntime_limit: 0.8 s\nbackend: mujoco")
    # The last target is 0.64 rad, and the lever lags by damping / stiffness = 0.05 s.
    expect = "expect: [{joint: {name: hinge, near: 0.6 rad, tolerance: 0.06 rad}, after: 0.79 s}]"
    (folder / "chunks.sim.yml").write_text("\n".join(expect if "expect" in line else line for line in text.split("\n")))
    ran = sim_action(folder, "run", "--no-report", "chunks.sim.yml")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    (outcome,) = outcomes(folder)
    assert outcome["provenance"]["packages"] == [f"onnxruntime {version('onnxruntime')}"]


def test_the_network_of_the_example_is_made_here() -> None:
    assert (ROOT / "examples/commands/balance.onnx").read_bytes() == balance()


def test_a_network_outside_of_the_workspace_is_refused(folder: Path) -> None:
    inside = write(folder / "repository/.git/HEAD", "").parents[1]
    (inside / "link.onnx").symlink_to(folder / "pd.onnx")
    (inside / "arm.urdf").write_text((folder / "arm.urdf").read_text())
    (inside / "policy.sim.yml").write_text(SCENARIO.format(name="p", commands=POLICY.replace("pd.onnx", "link.onnx")))
    ran = sim_action(inside, "run", "--no-report", "policy.sim.yml")
    assert ran.returncode == 2
    assert "outside the workspace" in ran.stdout + ran.stderr


def test_validate_without_onnxruntime_says_that_the_network_was_not_opened(folder: Path) -> None:
    (folder / "fake").mkdir()
    (folder / "fake/sitecustomize.py").write_text("import sys\nsys.modules['onnxruntime'] = None\n")
    ran = fresh_sim_action(folder, "validate", "policy.sim.yml", PYTHONPATH=f"{folder / 'fake'}:{ROOT}")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "not checked: policy pd.onnx: the network was not opened: policies need" in ran.stdout + ran.stderr


def test_validate_opens_the_network_in_a_process_of_its_own(folder: Path) -> None:
    # A module that ends its process takes the place of onnxruntime.
    (folder / "fake/onnxruntime").mkdir(parents=True)
    (folder / "fake/onnxruntime/__init__.py").write_text("import os\nos._exit(77)\n")
    ran = fresh_sim_action(folder, "validate", "policy.sim.yml", PYTHONPATH=f"{folder / 'fake'}:{ROOT}")
    assert ran.returncode == 2
    assert "pd.onnx made onnxruntime crash (status 77)" in ran.stdout + ran.stderr


CLIENT = ROOT / "examples/commands/policy_client.py"

SERVED = """\
name: server
robot: {{model: arm.urdf, base: fixed}}
commands:
  process: {{command: [python3, policy_client.py], with: {{joints: [shoulder, elbow], server: '{server}'}}}}
  rate: 20 Hz
  answer_within: 60 s
  start_within: 60 s
expect: [{{joint: {{name: shoulder, near: 20 deg, tolerance: 2 deg}}, after: 0.9 s}}]
duration: 1 s
time_limit: 1 s
"""


@pytest.fixture
def server() -> Iterator[tuple[str, list[dict[str, Any]]]]:
    """A server that answers with the same targets, and the bodies that it received."""
    bodies: list[dict[str, Any]] = []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            bodies.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            answer = json.dumps({"action": [0.35, 0.0]}).encode()
            self.send_response(200)
            self.send_header("Content-Length", str(len(answer)))
            self.end_headers()
            self.wfile.write(answer)

        def log_message(self, *_: object) -> None:
            pass

    with HTTPServer(("127.0.0.1", 0), Handler) as serving:
        thread = threading.Thread(target=serving.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{serving.server_address[1]}/act", bodies
        serving.shutdown()
        thread.join()


def folder_for(tmp_path: Path, server: str) -> Path:
    (tmp_path / "arm.urdf").write_text((ROOT / "examples/commands/arm.urdf").read_text())
    (tmp_path / "policy_client.py").write_text(CLIENT.read_text())
    (tmp_path / "s.sim.yml").write_text(SERVED.format(server=server))
    return tmp_path


def test_a_policy_behind_a_server_moves_the_joints(server: tuple[str, list[dict[str, Any]]], tmp_path: Path) -> None:
    address, bodies = server
    ran = sim_action(folder_for(tmp_path, address), "run", "--no-report", "s.sim.yml")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert [body["time"] for body in bodies] == [tick / 20 for tick in range(20)]
    assert all(len(body["observation.state"]) == 2 for body in bodies)


def test_a_server_on_another_machine_is_refused(tmp_path: Path) -> None:
    ran = sim_action(folder_for(tmp_path, "http://192.0.2.1:8000/act"), "run", "--no-report", "s.sim.yml")
    assert ran.returncode == 1
    (outcome,) = outcomes(tmp_path)
    assert "the server has to be on this machine" in json.dumps(outcome)
