"""Calls of `sim-action rostest` and `roslaunch` from end to end, beyond what examples do."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from junitparser import JUnitXml

from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from sim_action.state.trace_storage import load_trace
from tests.integration.conftest import fresh_sim_action, sim_action
from tests.ros.ros1.launches import ROOT, needs_ros, package
from tests.ros.ros1.robotis import lay_out

pytestmark = needs_ros
ROBOT = ROOT / "sim_action/ros/ros1/launch/packages/turtlebot3_description/urdf/turtlebot3_burger.urdf.xacro"
WORLD = '<include file="$(find gazebo_ros)/launch/empty_world.launch"/>'
BURGER = '<include file="$(find turtlebot3_gazebo)/launch/turtlebot3_empty_world.launch"/>'
WAITS = """\
#!/usr/bin/env python
import unittest, rospy, rostest
class Waits(unittest.TestCase):
    def test_waiting(self):
        rospy.init_node("waits")
        rospy.sleep(float(rospy.get_param("~seconds", 0.5)))
    def test_nothing(self):
        pass
rostest.rosrun("parts", "waits", Waits)
"""
TEST = '<test test-name="{name}" pkg="parts" type="waits.py" time-limit="60"><param name="seconds" value="{s}"/></test>'
DIES = (
    "#!/usr/bin/env python\nimport rospy\nrospy.init_node('dies')\nrospy.sleep(0.2)\nraise ValueError('no battery')\n"
)


def called(folder: Path, program: str, *words: str) -> tuple[int, list[Outcome], str]:
    """The exit code, the outcomes and the printed text of a call in a workspace."""
    # Forks of one process have its folder for temporary files.
    run = fresh_sim_action if "TMPDIR" in os.environ else sim_action
    done = run(folder, program, "--no-report", *words, COLUMNS="1000")
    results = Results.model_validate_json((folder / "sim-results/results.json").read_bytes())
    assert results.exit_code == done.returncode
    assert JUnitXml.fromfile(str(folder / "sim-results/junit.xml")).tests
    return done.returncode, list(results.outcomes), done.stdout


def test_a_launch_passes_at_its_limit_of_sim_time_also_where_temporary_files_have_blanks_in_their_paths(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path / "with a blank"))
    (tmp_path / "with a blank").mkdir()
    package(tmp_path, "parts", {"a.launch": f"<launch>{BURGER}</launch>"})
    code, [outcome], _ = called(tmp_path, "roslaunch", "--report", "parts", "a.launch", "--sim-time-limit", "0.5")

    assert code == 0
    assert (outcome.name, outcome.end) == ("parts/a.launch", "time limit")
    assert outcome.sim_time == pytest.approx(0.5, abs=0.02)
    assert outcome.replay is not None
    assert outcome.provenance is not None


@pytest.mark.soak
def test_what_takes_too_long_is_ended_by_the_wall_limit(tmp_path: Path) -> None:
    test = TEST.format(name="waits", s=50)
    package(tmp_path, "parts", {"a.test": f"<launch>{BURGER}{test}</launch>", "waits.py": WAITS})
    code, [outcome], _ = called(tmp_path, "rostest", "parts", "a.test", "--wall-limit", "15", "--rtf", "0.1")

    assert (code, outcome.status) == (1, "error")
    assert [failure.kind for failure in outcome.failures] == ["wall limit"]


@pytest.mark.soak
def test_a_model_is_spawned_from_a_file_where_and_as_it_is_asked_for(tmp_path: Path) -> None:
    spawn = (
        '<node pkg="gazebo_ros" name="spawn" type="spawn_model" args="-urdf -file $(find parts)/r.urdf -model r '
        '-x 1.5 -y -2 -Y 1.0 -J wheel_left_joint 0.5 -unpause"/>'
    )
    test = TEST.format(name="waits", s=0.2)
    paused = WORLD.replace("/>", '><arg name="paused" value="true"/></include>')
    files = {"a.test": f"<launch>{paused}{spawn}{test}</launch>", "waits.py": WAITS, "r.urdf": ROBOT.read_text()}
    package(tmp_path, "parts", files)
    code, [outcome], _ = called(tmp_path, "rostest", "parts", "a.test")

    assert code == 0, outcome
    assert outcome.trace is not None
    trace = load_trace(tmp_path / "sim-results" / outcome.trace)
    assert trace.base_position_xyz[0, :2] == pytest.approx([1.5, -2.0], abs=1e-3)


@pytest.mark.parametrize(
    ("words", "cause"),
    [
        (["prts", "a.test"], "there is no package 'prts'"),
        (["parts", "b.test"], "the package has no file 'b.test'; did you mean 'a.test'?"),
        (["parts", "a.test"], "has no <test>"),
    ],
)
def test_what_is_not_there_is_reported_with_the_nearest(tmp_path: Path, words: list[str], cause: str) -> None:
    package(tmp_path, "parts", {"a.test": "<launch/>"})
    code, [outcome], _ = called(tmp_path, "rostest", *words)
    assert code == 2
    assert cause in outcome.failures[0].message


LOSING_WORLD = """\
<launch>
  <include file="$(find gazebo_ros)/launch/empty_world.launch">
    <arg name="world_name" value="$(find parts)/worlds/{name}.world"/>
  </include>
  <param name="robot_description"
    command="$(find xacro)/xacro $(find turtlebot3_description)/urdf/turtlebot3_burger.urdf.xacro"/>
  <node name="s" pkg="gazebo_ros" type="spawn_model" args="-urdf -model burger -param robot_description"/>
  {test}
</launch>
"""
YARD = """\
<sdf version="1.6"><world name="yard">
  <include><uri>model://ground_plane</uri></include>
  <gui><camera name="c"/></gui><light name="l" type="point"/>
  <actor name="walker"/>
  <model name="rock"><static>1</static><pose>2 0 0 0 0 0</pose><link name="l"><collision name="c">
    <geometry><mesh><uri>model://rock/rock.obj</uri></mesh></geometry></collision></link></model>
  <plugin name="sky" filename="libsky.so"/>
</world></sdf>
"""


def test_a_launch_whose_required_node_does_not_exist_is_an_error(tmp_path: Path) -> None:
    launch = f'<launch>\n{BURGER}\n<node pkg="parts" name="driver" type="not_there.py" required="true"/>\n</launch>'
    package(tmp_path, "parts", {"a.launch": launch})

    words = ("--sim-time-limit", "0.5", "--allow-losses", "parts", "a.launch")
    code, [outcome], printed = called(tmp_path, "roslaunch", *words)

    (failure,) = outcome.failures
    assert (code, outcome.status, failure.title) == (2, "error", "no such node")
    assert str(failure.location) == "src/parts/a.launch:3"
    assert "the package 'parts' has no node 'not_there.py'" in failure.message
    assert "src/parts/a.launch:3" in printed


@pytest.mark.soak
def test_a_world_file_that_does_not_exist_is_an_error(tmp_path: Path) -> None:
    package(tmp_path, "parts", {"a.launch": LOSING_WORLD.format(name="yrad", test=""), "worlds/yard.world": YARD})

    code, [outcome], printed = called(tmp_path, "roslaunch", "--allow-losses", "parts", "a.launch")

    (failure,) = outcome.failures
    assert (code, outcome.status, failure.title) == (2, "error", "no such world")
    assert str(failure.location) == "src/parts/a.launch:3"
    assert failure.message.startswith("the world file 'src/parts/worlds/yrad.world' does not exist; did you mean 'yard")
    assert failure.message in printed


BALL = """\
<robot name="ball"><link name="base">
  <inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><sphere radius="0.1"/></geometry></collision>
  <contact><restitution value="0.9"/></contact>
</link></robot>
"""
THROWN = """\
<launch>
  <include file="$(find gazebo_ros)/launch/empty_world.launch"/>
  <param name="robot_description" textfile="$(find parts)/ball.urdf"/>
  <node name="s" pkg="gazebo_ros" type="spawn_model" args="-urdf -model ball -param robot_description"/>
  <node name="driver" pkg="parts" type="not_there.py"/>
</launch>
"""


@pytest.mark.soak
def test_a_robot_that_would_bounce_and_a_node_that_is_not_required_and_does_not_exist_are_losses(
    tmp_path: Path,
) -> None:
    package(tmp_path, "parts", {"a.launch": THROWN, "ball.urdf": BALL})
    words = ("--sim-time-limit", "0.5", "parts", "a.launch")
    bounces = "<restitution> is 0.9, but nothing bounces in the simulation"
    absent = "the node 'driver' (parts/not_there.py) was not started"

    code, [outcome], printed = called(tmp_path, "roslaunch", *words)
    assert (code, outcome.status) == (2, "error")
    of_robot, of_node = sorted(failure.message for failure in outcome.failures)
    assert bounces in of_robot
    assert "the package 'parts' has no node 'not_there.py'" in of_node

    code, [outcome], printed = called(tmp_path, "roslaunch", "--allow-losses", *words)
    assert (code, outcome.status) == (0, "passed")
    assert bounces in printed
    assert absent in printed


def test_what_a_world_and_a_robot_lose_is_an_error_unless_it_is_allowed(tmp_path: Path) -> None:
    test = TEST.format(name="waits", s=0.2)
    files = {"a.launch": LOSING_WORLD.format(name="yard", test=test), "worlds/yard.world": YARD, "waits.py": WAITS}
    package(tmp_path, "parts", files)
    words = ("--sim-time-limit", "2", "parts", "a.launch")
    lost = [
        ("src/parts/worlds/yard.world:4", "<actor> is not simulated: nothing can touch or see it"),
        ("src/parts/worlds/yard.world:6", "the mesh 'model://rock/rock.obj' of 'rock' was not found"),
        ("src/parts/worlds/yard.world:7", "the plugin sky of the world is not supported"),
    ]

    code, [outcome], printed = called(tmp_path, "rostest", *words)

    assert (code, outcome.status) == (2, "error")
    assert [str(failure.location) for failure in outcome.failures] == [place for place, _ in lost]
    assert all(message in printed for _, message in lost)

    code, [outcome], printed = called(tmp_path, "rostest", "--allow-losses", *words)

    assert (code, outcome.status) == (0, "passed")
    assert [str(warning.location) for warning in outcome.warnings] == [place for place, _ in lost]
    assert all(message in printed for _, message in lost)
    assert "--allow-losses" in outcome.call


RATES = """\
#!/usr/bin/env python
import unittest, rospy, rostest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
class Rates(unittest.TestCase):
    def test_rates(self):
        rospy.init_node("rates")
        odometry, joints = [], []
        rospy.Subscriber("/odom", Odometry, odometry.append, queue_size=100)
        rospy.Subscriber("/joint_states", JointState, joints.append, queue_size=100)
        rospy.sleep(0.5)
        start = rospy.get_time()
        rospy.sleep(3.0)
        stamps = [message.header.stamp.to_sec() for message in odometry]
        self.assertEqual(len([stamp for stamp in stamps if start < stamp <= start + 3.0]), 90)
        self.assertEqual(joints[0].name, ["wheel_left_joint", "wheel_right_joint"])
        self.assertEqual(len(joints[0].position), 2)
        diagonal = odometry[0].pose.covariance[::7]
        self.assertEqual([round(value, 6) for value in diagonal], [1e-5, 1e-5, 1e12, 1e12, 1e12, 1e-3])
rostest.rosrun("parts", "rates", Rates)
"""


@pytest.mark.soak
def test_the_plugins_of_robotis_have_their_rates_wheel_positions_and_covariances(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TURTLEBOT3_MODEL", "burger")
    lay_out(tmp_path)
    test = '<test test-name="rates" pkg="parts" type="rates.py" time-limit="60"/>'
    package(tmp_path, "parts", {"a.test": f"<launch>{BURGER}{test}</launch>", "rates.py": RATES})

    code, [outcome], printed = called(tmp_path, "rostest", "parts", "a.test")

    assert (code, outcome.status, outcome.warnings) == (0, "passed", ()), printed


@pytest.mark.soak
def test_a_test_that_runs_no_method_or_skips_all_does_not_pass(tmp_path: Path) -> None:
    nothing = WAITS.replace("def test_", "def check_")
    skipped = WAITS.replace("class Waits", "@unittest.skip('no battery')\nclass Waits")
    for text, status, message in ((nothing, "error", "ran no method"), (skipped, "not_exercised", "no battery")):
        launch = f"<launch>{BURGER}{TEST.format(name='waits', s=0.2)}</launch>"
        package(tmp_path, "parts", {"a.test": launch, "waits.py": text})

        code, [outcome], _ = called(tmp_path, "rostest", "parts", "a.test")

        assert (code, outcome.status) == (1, status)
        told = [failure.message for failure in outcome.failures]
        assert message in " ".join([*told, *(expected.verdict.message for expected in outcome.expectations)])


def test_a_node_that_dies_right_before_a_short_limit_fails_the_launch(tmp_path: Path) -> None:
    # The process needs longer to end than the rest of the simulation; rospy leaves the graph of nodes before that.
    slow = DIES.replace("import rospy", "import atexit, time\natexit.register(time.sleep, 1.5)\nimport rospy")
    launch = f'<launch>{BURGER}<node pkg="parts" name="it" type="dies.py"/></launch>'
    package(tmp_path, "parts", {"a.launch": launch, "dies.py": slow})

    code, [outcome], _ = called(tmp_path, "roslaunch", "--sim-time-limit", "0.4", "parts", "a.launch")

    assert (code, outcome.status) == (1, "failed")
    assert outcome.expectations[0].verdict.message.startswith("the node 'it' ended with exit code 1")


HEEDLESS = """\
#!/usr/bin/env python
import unittest, rospy, rostest
from std_msgs.msg import Float64
from std_srvs.srv import Trigger
class Heedless(unittest.TestCase):
    def served(self, request):
        self.fail("asked")
    def ticked(self, event):
        assert event.last_real, "ticked"
    def test_it(self):
        rospy.init_node("heedless")
        rospy.Service("/ask", Trigger, self.served)
        rospy.Timer(rospy.Duration(0.1), self.ticked)
        own = rospy.Publisher("/own", Float64, queue_size=1)
        subscribers = [rospy.Subscriber(topic, Float64, lambda message: None) for topic in ("/own", "/clearence")]
        rospy.sleep(0.3)
        with self.assertRaises(rospy.ServiceException):
            rospy.ServiceProxy("/ask", Trigger)()
rostest.rosrun("parts", "heedless", Heedless)
"""


def test_assertions_in_services_and_timers_fail_a_test_and_topics_without_a_publisher_are_named(tmp_path: Path) -> None:
    test = '<test test-name="heedless" pkg="parts" type="heedless.py" time-limit="20"/>'
    package(tmp_path, "parts", {"a.test": f"<launch>{BURGER}{test}</launch>", "heedless.py": HEEDLESS})
    _, [outcome], _ = called(tmp_path, "rostest", "parts", "a.test")

    held, callbacks, topic = outcome.expectations
    assert outcome.status == "failed"
    assert (held.verdict.passed, topic.name, topic.verdict.status) == (True, "/clearence", "not_exercised")
    assert "AssertionError: asked at src/parts/heedless.py:7" in callbacks.verdict.message
    assert "AssertionError: ticked at src/parts/heedless.py:9" in callbacks.verdict.message


EYED = """\
<robot name="eyed" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <link name="base_link"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
    </inertial><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
  <link name="arm"><inertial><mass value="0.1"/><inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/>
    </inertial></link>
  <link name="eye"/>
  <joint name="lift" type="prismatic"><parent link="base_link"/><child link="arm"/><origin xyz="0 0 0.2"/>
    <axis xyz="0 0 1"/><limit lower="0.1" upper="0.3" effort="10" velocity="1"/></joint>
  <joint name="eye_joint" type="fixed"><parent link="base_link"/><child link="eye"/><origin xyz="0.15 0 0"/></joint>
  <gazebo reference="eye"><sensor name="camera" type="depth"><update_rate>5</update_rate>
    <camera><horizontal_fov>1.5707963</horizontal_fov><image><width>8</width><height>6</height><format>B8G8R8</format>
    </image><clip><near>0.01</near><far>50</far></clip><depth_camera/></camera>
    <plugin name="eye" filename="libgazebo_ros_openni_kinect.so"><cameraName>front</cameraName>
    <frameName>optical</frameName><hackBaseline>0.1</hackBaseline><pointCloudCutoffMax>1</pointCloudCutoffMax></plugin></sensor></gazebo>
</robot>
"""
SEES = """\
#!/usr/bin/env python
import math, struct
import rospy
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2
from tf2_msgs.msg import TFMessage
rospy.init_node("sees")
image = rospy.wait_for_message("/front/image_raw", Image)
info = rospy.wait_for_message("/front/camera_info", CameraInfo)
assert (image.width, image.height, len(image.data), image.header.frame_id) == (8, 6, 144, "optical"), image
assert image.data[:3] != image.data[-3:], "the sky has the colour of the ground"
assert image.encoding == "bgr8" and image.data[0] > image.data[2], "the sky is blue"
assert abs(info.K[0] - 4) < 1e-6 and abs(info.P[3] + 0.4) < 1e-6 and info.width == 8, info
depth = rospy.wait_for_message("/front/depth/image_raw", Image)
depths = struct.unpack("<48f", depth.data)
assert depth.encoding == "32FC1" and 0.7 < depths[28] < 0.9, depths
assert math.isnan(depths[0]) and math.isnan(depths[44]), "neither the sky nor what is too near"
points = rospy.wait_for_message("/front/points", PointCloud2)
x, y, z = struct.unpack_from("<3f", points.data, 28 * points.point_step)
assert [field.name for field in points.fields] == ["x", "y", "z", "rgb"] and (points.width, points.row_step) == (8, 256)
assert abs(z - depths[28]) < 1e-3 and abs(x - z / 8) < 1e-3 and abs(y - z / 8) < 1e-3, (x, y, z)
joints = rospy.wait_for_message("/joint_states", JointState)
assert (joints.name, joints.position) == (["lift"], (0.2,)), joints
frames = {}
hear = lambda message: frames.update({frame.child_frame_id: frame for frame in message.transforms})
subscribers = [rospy.Subscriber(topic, TFMessage, hear) for topic in ("/tf", "/tf_static")]
assert rospy.wait_for_message("/again", CameraInfo).K == info.K
while len(frames) < 4:
    rospy.sleep(0.1)
places = {child: (frame.header.frame_id, frame.transform.translation) for child, frame in frames.items()}
assert (places["eye"][0], places["eye"][1].x) == ("base_link", 0.15), places
assert abs(places["arm"][1].z - 0.4) < 1e-9, places
assert (places["odom"][0], places["odom"][1].z, frames["odom"].transform.rotation.x) == ("map", 3, 1), frames
turned = frames["dock"].transform.rotation
assert places["dock"][0] == "map" and abs(turned.z - turned.w) < 1e-4 and turned.z > 0, frames
assert rospy.get_param("/joint_state_controller/publish_rate") == 50
rospy.spin()
"""


def test_files_are_launched_together_with_cameras_and_stand_ins_for_programs_of_ros(tmp_path: Path) -> None:
    spawn = '<node name="spawn" pkg="gazebo_ros" type="spawn_model" args="-urdf -param robot_description -model r"/>'
    description = """<param name="robot_description" command="xacro '$(find parts)/$(arg robot).xacro'"/>"""
    nodes = [(name, name, "") for name in ("robot_state_publisher", "joint_state_publisher")]
    nodes += [
        ("tf", "static_transform_publisher", "1 2 3 1 0 0 0 map odom 50"),
        ("tf2_ros", "static_transform_publisher", "0 0 0 1.5708 0 0 map dock"),
        ("topic_tools", "relay", "/front/camera_info /again"),
    ]
    states = "".join(f'<node name="{pkg}_" pkg="{pkg}" type="{kind}" args="{args}"/>' for pkg, kind, args in nodes)
    states += '<rosparam file="$(find joint_state_controller)/joint_state_controller.yaml"/>'
    files = {
        "world.launch": f'<launch><arg name="robot"/>{WORLD}{description}{spawn}</launch>',
        "nodes.launch": f'<launch><arg name="robot"/>{states}<node name="sees" pkg="parts" type="sees.py"/></launch>',
        "eyed.xacro": EYED,
        "sees.py": SEES,
    }
    package(tmp_path, "parts", files)
    words = ("parts", "world.launch", "parts", "nodes.launch", "robot:=eyed", "--sim-time-limit", "2")
    code, [outcome], printed = called(tmp_path, "roslaunch", *words)
    assert (code, outcome.status) == (0, "passed"), printed


def test_a_simulation_in_a_namespace_has_its_services_there(tmp_path: Path) -> None:
    spawn = '<node name="spawn" pkg="gazebo_ros" type="spawn_model" args="-urdf -param robot_description -model r {}"/>'
    description = """<param name="robot_description" command="xacro '$(find parts)/eyed.xacro'"/>"""
    inner = f"{WORLD}{description}{spawn.format('-gazebo_namespace //yard/gazebo')}"
    package(tmp_path, "parts", {"a.launch": f'<launch><group ns="yard">{inner}</group></launch>', "eyed.xacro": EYED})
    code, [outcome], printed = called(tmp_path, "roslaunch", "parts", "a.launch", "--sim-time-limit", "0.2")
    assert (code, outcome.status) == (0, "passed"), printed


@pytest.mark.parametrize(
    ("launch", "title", "message"),
    [
        (WORLD, "no robot", "no node of the launch spawns a robot, and the world has none"),
        pytest.param(
            f'{WORLD}<node name="d" pkg="parts" type="dies.py"/>',
            "no robot",
            "no node has spawned a robot within 10 s",
            marks=pytest.mark.soak,
        ),
        ('<node name="d" pkg="parts" type="dies.py"/>', "launch error", "the launch starts no simulation"),
    ],
    ids=["only a world", "no spawner", "no simulation"],
)
def test_a_launch_without_a_robot_ends_at_once(launch: str, title: str, message: str, tmp_path: Path) -> None:
    package(tmp_path, "parts", {"a.launch": f"<launch>{launch}</launch>", "dies.py": DIES.replace("0.2", "5")})
    code, [outcome], printed = called(tmp_path, "roslaunch", "parts", "a.launch")
    assert (code, [failure.title for failure in outcome.failures]) == (2, [title]), printed
    assert message in outcome.failures[0].message


def test_strict_fails_a_test_beside_a_node_that_died_also_if_its_end_takes_longer_than_the_test(tmp_path: Path) -> None:
    dies = '<node name="dies" pkg="parts" type="dies.py"/>'
    launch = f"<launch>{BURGER}{dies}{TEST.format(name='it', s=0.3)}</launch>"
    slow = DIES.replace("import rospy\n", "import atexit, time\natexit.register(time.sleep, 2)\nimport rospy\n")
    package(tmp_path, "parts", {"a.test": launch, "waits.py": WAITS, "dies.py": slow})
    code, [outcome], printed = called(tmp_path, "rostest", "--allow-losses", "--strict", "parts", "a.test")

    assert (code, outcome.status) == (1, "failed")
    assert [warning.rule for warning in outcome.warnings] == ["node-failed"]
    assert "node-failed" in printed
