"""Recorded logs drive robots: the same commands give the same run, whatever they were recorded in."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sim_action.engines import installed
from tests.commands.logs import bags
from tests.commands.logs.bags import WRITERS, csv_file, drive, joint_state, joints, mcap_file, ros1_bag, ros2_bag
from tests.integration.conftest import outcomes
from tests.integration.test_examples import sim_action

TWISTS = [(n / 20, 0.2 if n < 40 else 0.1, 0.5 if n % 40 < 20 else -0.3) for n in range(61)] + [(3.05, 0.0, 0.0)]

BURGER = """\
name: {name}
robot: {{model: turtlebot3_burger}}
commands:
  rate: 20 Hz
{commands}
expect: [upright: {{max_tilt: 20 deg}}]
time_limit: 4 s
"""

ARM_URDF = """\
<robot name="arm">
  <link name="world"/>
  <link name="upper"><inertial><origin xyz="0 0 0.2"/><mass value="1"/>
    <inertia ixx="0.02" iyy="0.02" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0 0 0.2"/><mass value="0.5"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="world"/><child link="upper"/><origin xyz="0 0 0.5"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="50" velocity="3"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0 0 0.4"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="50" velocity="3"/></joint>
</robot>
"""
ARM = """\
name: {name}
robot: {{model: arm.urdf}}
commands:
  rate: 20 Hz
{commands}
expect:
  - joint: {{name: elbow, at_least: 0.5}}
    after: 2 s
  - joint: {{name: shoulder, at_most: -0.5}}
    after: 2 s
time_limit: 3 s
"""


def write(folder: Path, template: str, name: str, **keys: object) -> None:
    commands = "\n".join(f"  {key}: {value}" for key, value in keys.items())
    (folder / f"{name}.sim.yml").write_text(template.format(name=name, commands=commands))


def run(folder: Path, *arguments: str) -> dict[str, dict[str, Any]]:
    sim_action(folder, "run", *arguments, ".")
    return {Path(outcome["file"]).name.removesuffix(".sim.yml"): outcome for outcome in outcomes(folder)}


@pytest.mark.parametrize("engine", installed())
def test_the_same_twists_give_the_same_run_in_every_format(engine: str, tmp_path: Path) -> None:
    csv_file(tmp_path / "monday.csv", TWISTS)
    write(tmp_path, BURGER, "csv", replay="monday.csv")
    for log, writer in WRITERS.items():
        writer(tmp_path / log, drive(TWISTS))
        write(tmp_path, BURGER, log, replay=log, topic="/cmd_vel", type=bags.TWIST)
    found = run(tmp_path, "--backend", engine)
    assert set(found) == {"csv", *WRITERS}
    assert {outcome["status"] for outcome in found.values()} == {"passed"}
    assert len({outcome["digest"] for outcome in found.values()}) == 1
    assert 0.3 < found["csv"]["travelled"] < 0.7


@pytest.mark.parametrize("engine", installed())
def test_the_same_joints_give_the_same_run_in_every_format(engine: str, tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM_URDF)
    positions = [(n / 10, -n / 20, n / 15) for n in range(16)]
    rows = "".join(f"{time},{shoulder!r},{elbow!r}\n" for time, shoulder, elbow in positions)
    (tmp_path / "arm.csv").write_text(f"time,position.shoulder,position.elbow\n{rows}")
    write(tmp_path, ARM, "csv", replay="arm.csv")

    def state(shoulder: float, elbow: float) -> Any:
        return lambda store: joint_state(store, ["elbow", "shoulder"], [elbow, shoulder], velocity=[9.0, 9.0])

    entries = joints(*((time, state(shoulder, elbow)) for time, shoulder, elbow in positions))
    for name, log in (("ros1", ros1_bag(tmp_path / "a.bag", entries)), ("ros2", ros2_bag(tmp_path / "b", entries))):
        write(tmp_path, ARM, name, replay=log.name, topic="/joint_states")
    found = run(tmp_path, "--backend", engine)
    assert {name: outcome["status"] for name, outcome in found.items()} == dict.fromkeys(found, "passed"), found
    assert len({outcome["digest"] for outcome in found.values()}) == 1


def test_an_arm_and_a_base_are_replayed_from_the_same_log_at_once(tmp_path: Path) -> None:
    state = joints((0.0, lambda store: joint_state(store, ["wheel_left_joint"], velocity=[3.0])), topic="/left")
    other = joints((0.0, lambda store: joint_state(store, ["wheel_right_joint"], velocity=[3.0])), topic="/right")
    mcap_file(tmp_path / "a.mcap", [*state, *other])
    sources = "".join(f"  - {{replay: a.mcap, topic: {topic}}}\n" for topic in ("/left", "/right"))
    (tmp_path / "both.sim.yml").write_text(
        f"name: both\nrobot: {{model: turtlebot3_burger}}\ncommands:\n{sources}"
        "expect: [travel: {at_least: 15 cm}]\ntime_limit: 4 s\n"
    )
    assert run(tmp_path)["both"]["status"] == "passed"
    (tmp_path / "both.sim.yml").write_text((tmp_path / "both.sim.yml").read_text().replace("/right", "/left"))
    found = run(tmp_path)["both"]
    assert found["status"] == "error"
    assert "both move joint 'wheel_left_joint'" in found["failures"][0]["message"]


def test_what_only_the_log_tells_is_an_invalid_scenario_on_its_line(tmp_path: Path) -> None:
    ros1_bag(tmp_path / "a.bag", drive(TWISTS))
    (tmp_path / "garbage.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(100))
    write(tmp_path, BURGER, "topic", replay="a.bag", topic="/odom")
    write(tmp_path, BURGER, "garbage", replay="garbage.mcap", topic="/cmd_vel")
    write(tmp_path, BURGER, "good", replay="a.bag", topic="/cmd_vel")
    (tmp_path / "listed.sim.yml").write_text(
        BURGER.format(name="listed", commands="  - {replay: a.bag, topic: /odom}").replace("  rate: 20 Hz\n", "")
    )
    ran = sim_action(tmp_path, "run", ".")
    assert ran.returncode == 2
    assert "Traceback" not in ran.stdout + ran.stderr
    found = {outcome["name"]: outcome for outcome in outcomes(tmp_path)}
    assert found["good"]["status"] == "passed"
    (failure,) = found["topic"]["failures"]
    assert failure["kind"] == "invalid"
    assert failure["location"] == {"file": "topic.sim.yml", "line": 6, "column": 3}
    assert failure["message"].startswith("commands.topic: a.bag: the log has no topic '/odom'")
    (failure,) = found["listed"]["failures"]
    assert failure["location"] == {"file": "listed.sim.yml", "line": 4, "column": 21}
    assert failure["message"].startswith("commands.0.topic: a.bag: the log has no topic")
    (failure,) = found["garbage"]["failures"]
    assert failure["kind"] == "invalid"
    assert failure["message"].startswith("commands.replay: garbage.mcap: the log cannot be read: ")


def test_a_bomb_costs_its_own_scenario_and_no_other(tmp_path: Path) -> None:
    mcap_bomb(tmp_path / "bomb.mcap", 3 << 30)
    csv_file(tmp_path / "monday.csv", TWISTS)
    write(tmp_path, "memory_limit: 1 GiB\n" + BURGER, "bomb", replay="bomb.mcap", topic="/cmd_vel")
    write(tmp_path, BURGER, "good", replay="monday.csv")
    found = run(tmp_path)
    assert found["good"]["status"] == "passed"
    (failure,) = found["bomb"]["failures"]
    assert failure["kind"] == "memory"
    assert failure["message"].startswith(
        "bomb.mcap: the log is too large when it is unpacked, or it is damaged; it needs more"
    )
    assert "1 GiB of memory" in failure["message"]


def mcap_bomb(path: Path, size: int) -> None:
    """Replaces the messages of a log by zeros without end, in less than a megabyte."""
    from backports import zstd

    mcap_file(path, drive(TWISTS))
    chunk = zstd.ZstdCompressor()
    zeros = bytes(64 << 20)
    packed = b"".join(chunk.compress(zeros) for _ in range(size // len(zeros))) + chunk.flush()
    times = bytes(16) + size.to_bytes(8, "little") + bytes(4)
    record = times + text("zstd") + len(packed).to_bytes(8, "little") + packed
    header = text("ros2") + text("")
    footer = b"\x02" + (20).to_bytes(8, "little") + bytes(20)
    magic = b"\x89MCAP0\r\n"
    path.write_bytes(magic + of(1, header) + of(6, record) + footer + magic)


def of(kind: int, record: bytes) -> bytes:
    return bytes([kind]) + len(record).to_bytes(8, "little") + record


def text(value: str) -> bytes:
    return len(value).to_bytes(4, "little") + value.encode()


def test_validate_leaves_logs_of_ros_alone_and_says_so(tmp_path: Path) -> None:
    (tmp_path / "a.bag").write_bytes(b"whatever this is")
    csv_file(tmp_path / "monday.csv", TWISTS)
    write(tmp_path, BURGER, "any", replay="a.bag", topic="/cmd_vel")
    write(tmp_path, BURGER, "csv", replay="monday.csv")
    ran = sim_action(tmp_path, "validate", ".")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "any.sim.yml: not checked: topics of a.bag: the log is read when the scenario runs" in ran.stdout
    assert "csv.sim.yml: not checked" not in ran.stdout
