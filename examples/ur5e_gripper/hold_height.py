"""Hold the height of the tool with one joint: the pose of every link is part of the observation."""

from sim_action import JointTargets, Observation

HEIGHT = 0.6  # m
GAIN = 3.0  # rad/s per m


def control(observation: Observation) -> JointTargets:
    """Turn the shoulder towards the height; it lowers the arm when it turns forward."""
    height = observation.links["tool0"].pose.position_xyz[2]
    return JointTargets(velocity={"shoulder_lift_joint": GAIN * (height - HEIGHT)})
