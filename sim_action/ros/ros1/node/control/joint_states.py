"""The controller that tells where joints are."""

from __future__ import annotations

from sensor_msgs.msg import JointState

from sim_action.ros.ros1.node.control import Controller, Opening
from sim_action.ros.ros1.node.devices import Device, period_of
from sim_action.ros.ros1.node.messages import header
from sim_action.state.observation import Observation


def open_joint_states(opening: Opening) -> Controller:
    """joint_state_controller/JointStateController: of joints with a transmission, in the order of their names."""
    moving = {joint.name for joint in opening.wiring.model.moving_joints}
    names = sorted(moving.intersection(opening.transmissions.interfaces)) or sorted(moving)
    sender = opening.wiring.sender(f"{opening.space}/joint_states", JointState)

    def publish(seconds: float, seen: Observation) -> None:
        if names:
            positions, velocities, efforts = zip(*(seen.joints[name] for name in names), strict=True)
            sender.send(JointState(header(seconds, ""), names, positions, velocities, efforts))

    period = period_of(opening.parameters.number("publish_rate", 50.0))
    return Controller("hardware_interface/JointStateInterface", device=Device(period, (sender,), publish))
