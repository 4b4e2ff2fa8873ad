"""The adapter of examples/: a `process` that asks a policy server on this machine."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest

from tests.integration.conftest import outcomes, sim_action

ROOT = Path(__file__).parents[2]
CLIENT = ROOT / "examples/commands/policy_client.py"

SCENARIO = """\
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
    (tmp_path / "s.sim.yml").write_text(SCENARIO.format(server=server))
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
