"""The program `spawn_model` of gazebo_ros: asks the simulation to spawn a model from a parameter or a file."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import rospy
from gazebo_msgs.srv import DeleteModel, GetWorldProperties, SetModelConfiguration, SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion
from std_srvs.srv import Empty

from sim_action.core.geometry import quaternion_from_rpy

_POSE_FLAGS: Final = ("x", "y", "z", "R", "P", "Y")
_MAX_SHUTDOWN_S: Final = 2
# The first value of the master's answers (ROS Master API).
_SUCCESS: Final = 1
_POLL_S: Final = 0.02


def spawn() -> int:
    """Spawn a model, and return the exit code."""
    rospy.init_node("spawn_model", anonymous=True)
    asked, unknown = _parser().parse_known_args(rospy.myargv()[1:])
    if unknown:
        rospy.logwarn("spawn_model: unknown arguments: %s", " ".join(unknown))
    space = asked.gazebo_namespace.rstrip("/")
    try:
        text = _text(asked)
        description = text.replace("package://", "model://") if asked.package_to_model else text
    except (OSError, KeyError) as error:
        return _complain(f"there is no model to spawn: {error}")
    if asked.wait:
        look = _service(space, "get_world_properties", GetWorldProperties)
        while asked.wait not in look().model_names and not rospy.is_shutdown():
            time.sleep(_POLL_S)
    for answer in _answers(space, asked, description):
        if not answer.success:
            return _complain(answer.status_message)
    if asked.unpause:
        _service(space, "unpause_physics", Empty)()
    if asked.b:
        _stay(space, asked.model)
    return 0


def _answers(space: str, asked: argparse.Namespace, description: str) -> Iterator[Any]:
    """Yield the answers of one service after another; the caller stops at the first failure."""
    yield _asked(space, asked, description)
    if asked.joints:
        names, values = zip(*asked.joints, strict=True)
        call = _service(space, "set_model_configuration", SetModelConfiguration)
        yield call(asked.model, asked.param or "", list(names), list(map(float, values)))


def _stay(space: str, model: str) -> None:
    """Wait until the program is asked to leave; then delete the model."""
    delete = _service(space, "delete_model", DeleteModel)
    rospy.spin()
    # The simulation may have been asked to leave at the same time.
    signal.alarm(_MAX_SHUTDOWN_S)
    with suppress(rospy.ServiceException, rospy.ROSException):
        delete(model)


def _asked(space: str, asked: argparse.Namespace, description: str) -> Any:
    x, y, z, roll, pitch, yaw = (getattr(asked, name) for name in _POSE_FLAGS)
    pose = Pose(Point(x, y, z), Quaternion(*quaternion_from_rpy(roll, pitch, yaw)))
    kind = "sdf" if asked.sdf else "urdf"
    call = _service(space, f"spawn_{kind}_model", SpawnModel)
    return call(asked.model, description, asked.robot_namespace, pose, asked.reference_frame)


def _service(space: str, name: str, kind: Any) -> Any:
    called = rospy.resolve_name(f"{space}/{name}")
    # rospy's own wait for services polls only three times per second.
    while not (rospy.is_shutdown() or _is_there(called)):
        time.sleep(_POLL_S)
    rospy.wait_for_service(called)
    return rospy.ServiceProxy(called, kind)


def _is_there(service: str) -> bool:
    with suppress(OSError):
        code, *_ = rospy.get_master().lookupService(service)
        return bool(code == _SUCCESS)
    return False


def _text(asked: argparse.Namespace) -> str:
    """Return the text of the description. Raises OSError, KeyError."""
    if asked.param:
        return str(rospy.get_param(asked.param))
    if asked.file:
        return Path(asked.file).read_text(encoding="utf-8")
    if asked.database:
        return _of_database(asked.database).read_text(encoding="utf-8")
    return sys.stdin.read()


def _of_database(name: str) -> Path:
    """Return the file of a model in GAZEBO_MODEL_PATH. Raises FileNotFoundError."""
    folders = [Path(folder) for folder in os.environ.get("GAZEBO_MODEL_PATH", "").split(os.pathsep) if folder]
    for folder in folders:
        if (path := folder / name / "model.sdf").is_file():
            return path
    raise FileNotFoundError(f"GAZEBO_MODEL_PATH has no model '{name}'; models are not downloaded")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("spawn_model", prefix_chars="-", allow_abbrev=False)
    for flag in ("-urdf", "-sdf", "-gazebo", "-unpause", "-stdin", "-b", "-package_to_model"):
        parser.add_argument(flag, action="store_true")
    for name in ("-param", "-file", "-database", "-wait", "-trimesh_mode"):
        parser.add_argument(name)
    parser.add_argument("-model", required=True)
    for name in _POSE_FLAGS:
        parser.add_argument(f"-{name}", type=float, default=0.0)
    parser.add_argument("-J", dest="joints", nargs=2, action="append")
    parser.add_argument("-reference_frame", default="")
    parser.add_argument("-robot_namespace", default=rospy.get_namespace())
    parser.add_argument("-gazebo_namespace", default="/gazebo")
    return parser


def _complain(message: str) -> int:
    rospy.logerr("spawn_model: %s", message)
    return 1
