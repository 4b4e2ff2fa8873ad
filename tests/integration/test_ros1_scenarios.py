"""Scenarios whose robots are driven by real nodes of ROS 1, and all that may go wrong with these."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.integration.conftest import fresh_sim_action, outcomes
from tests.integration.marked_processes import wait_for
from tests.integration.test_examples import ROOT, sim_action
from tests.patience import PATIENCE, wait_until
from tests.ros.ros1.launches import needs_ros, package
from tests.soak import soaked

pytestmark = needs_ros
HEAD = "#!/usr/bin/env python\nimport os\nimport rospy\nfrom geometry_msgs.msg import Twist\n"
# Drives on, and does something else half a second later.
DRIVE = f"""{HEAD}
def drive(then=lambda: None, topic="/cmd_vel", speed=0.5):
    commands = rospy.Publisher(topic, Twist, queue_size=1)
    rate = rospy.Rate(10)
    twist = Twist()
    twist.linear.x = speed
    while not rospy.is_shutdown():
        commands.publish(twist)
        if rospy.get_time() >= 0.5:
            then()
        rate.sleep()
"""
NODES = {
    "mover.py": f'{DRIVE}\nrospy.init_node("mover")\ndrive(speed=rospy.get_param("~speed", 0.5))\n',
    "crasher.py": f'{DRIVE}\n\ndef crash():\n    1 / 0\n\n\nrospy.init_node("crasher")\ndrive(crash)\n',
    "killed.py": f'{DRIVE}\nrospy.init_node("killed")\ndrive(lambda: os.kill(os.getpid(), 9))\n',
    "misled.py": f'{DRIVE}\nrospy.init_node("misled")\ndrive(topic="/cmd_vell")\n',
    "lost.py": f'{DRIVE}\nrospy.init_node("lost")\ndrive(speed=float("nan"))\n',
    "done.py": f'{HEAD}\nrospy.init_node("done")\nrospy.sleep(0.3)\n',
    "deaf.py": f"""{DRIVE}
from nav_msgs.msg import Odometry
rospy.init_node("deaf")
rospy.Subscriber("/joint_states", Odometry, lambda message: None)
drive(lambda: None)
""",
    "stamped.py": f"""{HEAD}
from geometry_msgs.msg import TwistStamped
rospy.init_node("stamped")
rospy.Publisher("/cmd_vel", TwistStamped, queue_size=1)
rospy.spin()
""",
    "importer.py": f"{HEAD}\nimport no_such_module\n",
    "sleeper.py": f"{HEAD}\nimport time\ntime.sleep(600)\n",
}


def scenario(folder: Path, ros1: str, more: str = "") -> None:
    """One in an otherwise empty repository with a workspace; what is said of nodes stands on line 4."""
    (folder / ".git").mkdir()
    package(folder / "ws", "nodes", NODES)
    # A busy machine takes many seconds for the start of a node.
    ros1 = ros1 if "start_within" in ros1 else f"{ros1[:-1]}, start_within: 120 s}}"
    text = f"name: driven\nrobot: {{model: turtlebot3_burger}}\ncommands:\n  ros1: {ros1}\n{more}"
    expected = "expect:\n  - travel: {at_least: 0.4 m}\ntime_limit: 2 s\n"
    wall = "" if "wall_limit:" in more else "wall_limit: 600 s\n"
    (folder / "ws/s.sim.yml").write_text(text + ("" if "expect:" in more else expected) + wall)


def ran(folder: Path, *words: str) -> tuple[int, dict[str, Any]]:
    done = sim_action(folder, "run", "ws/s.sim.yml", "--no-report", *words)
    (outcome,) = outcomes(folder)
    return done.returncode, outcome


# Node -> the file that its failure names, and causes.
FAILURES = {
    "crasher": ("crasher.py", ["'crasher' ended with exit code 1: ZeroDivisionError"]),
    "killed": ("s.sim.yml", ["'killed' ended with SIGKILL"]),
    "importer": ("importer.py", ["'importer' ended with exit code 1", "no_such_module"]),
}


@pytest.mark.parametrize("node", FAILURES)
def test_a_node_that_dies_is_an_error_with_its_cause(node: str, tmp_path: Path) -> None:
    file, causes = FAILURES[node]
    scenario(tmp_path, f"{{nodes: [nodes/mover.py, nodes/{node}.py]}}")
    code, outcome = ran(tmp_path)
    (failure,) = outcome["failures"]
    assert (code, outcome["status"], failure["kind"]) == (1, "error", "script")
    assert all(cause in failure["message"] for cause in causes), failure
    assert Path(failure["location"]["file"]).name == file
    lines = NODES.get(file, "\n\n\n1 / 0").splitlines()
    guilty = next(number for number, line in enumerate(lines, 1) if "1 / 0" in line or "no_such_module" in line)
    assert failure["location"]["line"] == guilty
    # It is at the same moment however long it takes a process to be gone.
    assert node == "importer" or "at 0.5" in failure["message"] or "at 0.6" in failure["message"], failure


def test_nodes_may_leave_and_put_away_what_they_have_once_the_run_is_over(tmp_path: Path) -> None:
    scenario(tmp_path, "{nodes: [nodes/keeper.py, nodes/done.py], topics: {cmd_vel: /cmd_vell}}")
    saved = tmp_path / "saved"
    keeps = f'rospy.on_shutdown(lambda: (rospy.rostime.wallsleep(0.5), open("{saved}", "w").close()))'
    keeper = f'{DRIVE}\nrospy.init_node("keeper")\n{keeps}\ndrive(topic="/cmd_vell")\n'
    package(tmp_path / "ws", "nodes", {"keeper.py": keeper})
    code, outcome = ran(tmp_path)
    assert (code, outcome["status"]) == (0, "passed"), outcome
    assert saved.exists()
    assert not [note for note in outcome["notes"] if "left behind" in note]


def test_a_required_node_that_is_done_is_an_error(tmp_path: Path) -> None:
    scenario(tmp_path, "{nodes: [nodes/mover.py, {package: nodes, type: done.py, required: true}]}")
    code, outcome = ran(tmp_path)
    assert (code, outcome["status"]) == (1, "error")
    assert "'done' finished during the run, and it is required" in outcome["failures"][0]["message"]


def test_a_process_that_becomes_no_node_is_not_waited_for_and_a_robot_that_nobody_drives_is_named(
    tmp_path: Path,
) -> None:
    # Long enough for the other one on a busy machine.
    scenario(tmp_path, "{nodes: [nodes/misled.py, nodes/sleeper.py], start_within: 15 s}")
    code, outcome = ran(tmp_path)
    assert (code, outcome["status"]) == (1, "failed")
    (note,) = [note for note in outcome["notes"] if "no node drove the robot" in note]
    assert "topics: {cmd_vel: /cmd_vell}" in note
    assert any("sleeper.py' did not become a ROS node within 15 s" in note for note in outcome["notes"]), outcome
    assert outcome["sim_time"] > 0


def test_parts_of_a_launch_file_that_a_scenario_does_not_replace_are_an_error_unless_allowed(tmp_path: Path) -> None:
    folder = tmp_path / "a b"
    folder.mkdir()
    scenario(folder, "{launch: [nodes, drive.launch, 'speed:=0.5']}")
    text = """\
<launch>
  <arg name="speed" default="0"/>
  <include file="$(find gazebo_ros)/launch/empty_world.launch"><arg name="world_name" value="/a/yard.world"/></include>
  <param name="robot_description" command="$(find xacro)/xacro $(find nodes)/robot.xacro"/>
  <node pkg="gazebo_ros" type="spawn_model" name="spawn" args="-urdf -model r -param robot_description"/>
  <node pkg="gazebo_ros" type="spawn_model" name="box" args="-sdf -model box -file box.sdf"/>
  <param name="arm/type" value="position_controllers/JointTrajectoryController"/>
  <node pkg="controller_manager" type="spawner" name="controllers" args="arm"/>
  <node pkg="nodes" type="mover.py" name="mover"><param name="speed" value="$(arg speed)"/></node>
</launch>
"""
    files = {"drive.launch": text, "robot.xacro": '<robot name="r"><link name="base"/></robot>'}
    package(folder / "ws", "nodes", files)
    lost = ["the world 'yard.world'", "the model 'box'", "the controller 'arm' (position_controllers/Joint"]
    code, outcome = ran(folder)
    (failure,) = outcome["failures"]
    assert (code, outcome["status"], failure["location"]["line"]) == (2, "error", 4)
    assert all(each in failure["message"] for each in [*lost, "allow_losses: true"]), failure
    path = folder / "ws/s.sim.yml"
    path.write_text(path.read_text().replace("'speed:=0.5']", "'speed:=0.5'], allow_losses: true"))
    code, outcome = ran(folder)
    assert (code, outcome["status"]) == (0, "passed"), outcome
    told = [warning["message"] for warning in outcome["warnings"] if warning["rule"] == "not-simulated"]
    assert [message.startswith(each) for message, each in zip(told, lost, strict=True)] == [True] * 3
    assert [note for note in outcome["notes"] if "gazebo_ros/spawn_model, controller_manager/spawner" in note]


def test_a_subscriber_of_another_type_is_named_with_both_types_and_not_waited_for(tmp_path: Path) -> None:
    scenario(tmp_path, "{nodes: [nodes/deaf.py]}")
    code, outcome = ran(tmp_path)
    assert (code, outcome["status"], outcome["warnings"]) == (0, "passed", [])
    subscribes = "the node 'deaf' subscribes to /joint_states as nav_msgs/Odometry"
    assert f"{subscribes}, but the robot publishes sensor_msgs/JointState" in outcome["notes"]


def test_a_publisher_of_commands_of_another_type_is_named_with_both_types(tmp_path: Path) -> None:
    scenario(tmp_path, "{nodes: [nodes/stamped.py]}")
    _, outcome = ran(tmp_path)
    other = "but the node 'stamped' publishes geometry_msgs/TwistStamped"
    assert f"the robot subscribes to /cmd_vel as geometry_msgs/Twist, {other}" in outcome["notes"]
    assert not any("had no connection" in warning["message"] for warning in outcome["warnings"])


def test_a_command_that_is_no_number_is_an_error(tmp_path: Path) -> None:
    scenario(tmp_path, "{nodes: [nodes/lost.py]}")
    code, outcome = ran(tmp_path)
    assert (code, outcome["status"]) == (1, "error")
    assert "a node sent a bad command on /cmd_vel: Twist(" in outcome["failures"][0]["message"]
    assert "has a value that is not finite" in outcome["failures"][0]["message"]


def test_messages_that_cannot_be_written_are_told_at_the_scenario(tmp_path: Path) -> None:
    scenario(tmp_path, "{nodes: [nodes/mover.py]}")
    package(tmp_path / "ws", "broken", {"msg/Broken.msg": "no_such_type field\n"})
    code, outcome = ran(tmp_path)
    assert (code, outcome["status"]) == (2, "error")
    assert "genpy cannot generate the messages of broken" in outcome["failures"][0]["message"]
    assert outcome["failures"][0]["location"]["line"] == 4


@pytest.mark.soak
def test_a_node_that_never_waits_costs_lock_step_and_that_is_told(tmp_path: Path) -> None:
    scenario(tmp_path, "{nodes: [nodes/spinner.py]}")
    spins = "import threading\n\n\ndef spin():\n    while True:\n        pass\n\n\n"
    begun = "threading.Thread(target=spin, daemon=True).start()\n"
    package(tmp_path / "ws", "nodes", {"spinner.py": f'{DRIVE}\n{spins}rospy.init_node("spinner")\n{begun}drive()\n'})
    _, outcome = ran(tmp_path)
    (warning,) = [each for each in outcome["warnings"] if each["rule"] == "not-reproducible"]
    assert "lock-step was lost at 0 s of sim time: the node 'spinner' was still busy" in warning["message"]


# Node -> the statement of its loop, and what is said of it.
BY_THE_WALL_CLOCK = {
    "sleeping": ("time.sleep(0.05)", "it calls time.sleep again and again at ws/src/nodes/sleeping.py:10"),
    # Such as a timer of roscpp.
    "polling": ("threading.Event().wait(0.001)", "times per second of wall time while the clock stands still"),
}


def test_nodes_that_act_by_the_wall_clock_or_whose_callbacks_raise_are_named_and_others_are_not(tmp_path: Path) -> None:
    # A fast machine simulates 2 s before the node has slept long enough to be noticed.
    longer = "expect:\n  - max_speed: {linear: 2}\ntime_limit: 8 s\n"
    nodes = "{package: nodes, type: mover.py, params: {speed: 0.4}}, nodes/sleeping.py, nodes/polling.py"
    scenario(tmp_path, f"{{nodes: [{nodes}, nodes/heedless.py]}}", longer)
    hears = "from nav_msgs.msg import Odometry\n\n\ndef look(message):\n    message.no_such_field\n\n\n"
    listens = 'rospy.init_node("heedless")\nrospy.Subscriber("/odom", Odometry, look)\nrospy.spin()\n'
    package(tmp_path / "ws", "nodes", {"heedless.py": f"{HEAD}{hears}{listens}"})
    for name, (waits, _) in BY_THE_WALL_CLOCK.items():
        loop = f'rospy.init_node("{name}")\nwhile not rospy.is_shutdown():\n    {waits}\n'
        package(tmp_path / "ws", "nodes", {f"{name}.py": f"{HEAD}import threading\nimport time\n\n{loop}"})
    _, outcome = ran(tmp_path)
    said = sorted(each["message"] for each in outcome["warnings"] if each["rule"] == "not-reproducible")
    assert len(said) == 2, said
    for message, (name, (_, why)) in zip(said, sorted(BY_THE_WALL_CLOCK.items()), strict=True):
        assert f"the node '{name}' does not wait for sim time" in message
        assert why in message
    (note,) = [note for note in outcome["notes"] if "callback" in note]
    assert "a callback of the node 'heedless' raised" in note
    assert "no_such_field" in note
    assert "ws/src/nodes/heedless.py:" in note
    assert not [note for note in outcome["notes"] if "lock-step" in note]


def test_where_ros_is_absent_one_message_says_what_to_type(tmp_path: Path) -> None:
    scenario(tmp_path, "{nodes: [nodes/mover.py]}")
    # Read by each interpreter as it starts.
    absent = "from pathlib import Path\nfrom sim_action.ros.ros1 import installation\n"
    (tmp_path / "sitecustomize.py").write_text(f"{absent}installation.PYTHON = Path('/no/python')\n")
    words = ("run", "ws/s.sim.yml", "--no-report")
    done = fresh_sim_action(tmp_path, *words, PYTHONPATH=f"{tmp_path}:{ROOT}", COLUMNS="1000")
    assert done.returncode == 2, done.stdout + done.stderr
    assert "invalid scenario: commands.ros1: ROS 1 is not installed" in done.stdout
    assert "sudo apt-get install --no-install-recommends python3-rospy" in done.stdout
    assert "s.sim.yml:4:3" in done.stdout


LAUNCHES = [
    pytest.param('<launch><include file="$(find nods)/x.launch"/></launch>', ["'nods'", "'nodes'"], id="no package"),
    pytest.param("<launch><group><param name='x'/></group></launch>", ["param", "x"], marks=pytest.mark.soak),
]


@pytest.mark.parametrize(("text", "causes"), LAUNCHES)
def test_a_launch_file_that_cannot_be_launched_is_an_error(text: str, causes: list[str], tmp_path: Path) -> None:
    scenario(tmp_path, "{launch: [nodes, drive.launch]}")
    (tmp_path / "ws/src/nodes/drive.launch").write_text(text)
    code, outcome = ran(tmp_path)
    (failure,) = outcome["failures"]
    assert (code, outcome["status"]) == (1, "error")
    assert all(cause in failure["message"] for cause in causes), failure
    assert (failure["location"]["line"], failure["location"]["column"]) == (4, 3)


PROBE = f"""{HEAD}
import json, sys
from gazebo_msgs.msg import ModelStates
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image, Imu, JointState, LaserScan
from std_msgs.msg import Bool
from tf2_msgs.msg import TFMessage
KINDS = {{
    "/odom": Odometry, "/joint_states": JointState, "/scan": LaserScan, "/imu": Imu, "/bumper": Bool,
    "/eye/image_raw": Image, "/tf": TFMessage, "/gazebo/model_states": ModelStates,
}}
heard = {{topic: [0, ""] for topic in KINDS}}

def hear(message, topic):
    heard[topic][0] += 1
    heard[topic][1] = message.header.frame_id if hasattr(message, "header") else ""
    if topic == "/gazebo/model_states":
        heard[topic][1] = " ".join(message.name)

rospy.init_node("probe")
for topic, kind in KINDS.items():
    rospy.Subscriber(topic, kind, hear, topic)
rospy.sleep(1.005)
heard["parameters"] = [rospy.get_param("/use_sim_time"), rospy.get_param("/robot_description")[:6]]
with open(sys.argv[1], "w") as file:
    json.dump(heard, file)
rospy.spin()
"""
SENSORS = """\
world: {objects: [{name: wall, box: [0.1, 1, 1], pose: {x: 2}}]}
sensors:
  - {lidar: {rays: 36}, link: base_scan, rate: 5 Hz}
  - {imu: {}, rate: 120 Hz}
  - {contact: {}, link: wheel_left_link, rate: 24 Hz}
  - {camera: {width: 8, height: 6}, name: eye, rate: 2 Hz}
expect: [no_collision]
time_limit: 1.5 s
"""


def test_nodes_hear_of_the_robot_and_its_sensors(tmp_path: Path) -> None:
    heard = tmp_path / "heard.json"
    probe = f"{{package: nodes, type: probe.py, args: '{heard}'}}"
    scenario(tmp_path, f"{{nodes: [{probe}], topics: {{contact: /bumper}}}}", SENSORS)
    package(tmp_path / "ws", "nodes", {"probe.py": PROBE})
    code, outcome = ran(tmp_path)
    assert code == 0, outcome
    told = json.loads(heard.read_text())
    assert told == {
        # From 0 s to the tick at which 1.005 s have gone by since the first that a clock tells.
        "/odom": [31, "odom"],
        "/joint_states": [31, ""],
        "/scan": [6, "base_scan"],
        "/imu": [123, "base_footprint"],
        "/bumper": [25, ""],
        "/eye/image_raw": [3, "base_footprint"],
        "/tf": [31, ""],
        "/gazebo/model_states": [123, "ground_plane wall turtlebot3_burger"],
        "parameters": [True, "<robot"],
    }


@pytest.mark.parametrize("number", soaked([signal.SIGINT, signal.SIGKILL], short=[signal.SIGKILL]))
def test_nothing_of_a_run_is_left_whoever_ends_it(number: signal.Signals, tmp_path: Path) -> None:
    begun = tmp_path / "begun"
    more = "expect: [no_collision]\ntime_limit: 1000 s\nwall_limit: 500 s\n"
    scenario(tmp_path, "{nodes: [nodes/stays.py]}", more)
    stays = f'{DRIVE}\nrospy.init_node("stays")\ndrive(lambda: open("{begun}", "w").close())\n'
    package(tmp_path / "ws", "nodes", {"stays.py": stays})
    command = [sys.executable, "-m", "sim_action", "run", "ws/s.sim.yml", "--no-report"]
    variables = {**os.environ, "PYTHONPATH": str(ROOT), "ROS_MARK": str(tmp_path)}
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "start_new_session": True}
    call = subprocess.Popen(command, cwd=tmp_path, env=variables, **quiet)
    try:
        wait_until(begun.exists)
        os.kill(call.pid, number)
        call.wait(PATIENCE)
    finally:
        call.kill()
    wait_for(0, tmp_path)


def test_readings_reach_nodes_late_and_each_message_of_a_node_may_be_lost_once(tmp_path: Path) -> None:
    late = "  latency: 0.1 s\n  dropouts: 0.5\nsensors: [{imu: {}, rate: 10 Hz, latency: 0.2 s}]\n"
    scenario(tmp_path, "{nodes: [nodes/mover.py, nodes/listener.py]}", f"{late}expect: [upright]\ntime_limit: 2 s\n")
    heard = tmp_path / "heard"
    logged = "lambda said: print(said.header.stamp, rospy.get_time(), file=LOG, flush=True)"
    text = f'{HEAD}from sensor_msgs.msg import Imu\nLOG = open("{heard}", "w")\nrospy.init_node("listener")\n'
    listens = f'rospy.Subscriber("/imu", Imu, {logged})\nrospy.spin()\n'
    package(tmp_path / "ws", "nodes", {"listener.py": text + listens})
    code, outcome = ran(tmp_path)
    assert (code, outcome["status"]) == (0, "passed"), outcome
    rows = [tuple(map(float, line.split())) for line in heard.read_text().splitlines()]
    stamps = [round(nanoseconds / 1e9, 3) for nanoseconds, _ in rows]
    assert stamps == [number / 10 for number in range(18)]
    # The first reading is there from the start. A node hears of a moment before the clock that goes with it.
    assert all(0.18 < seconds - stamp < 0.21 for stamp, (_, seconds) in zip(stamps[1:], rows[1:], strict=True))
    (lost,) = (note for note in outcome["notes"] if "were lost" in note)
    count, _, sent, *_ = lost.split()
    assert 19 <= int(sent) <= 21
    assert 3 <= int(count) <= 17
