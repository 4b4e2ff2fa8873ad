"""Nodes of ROS 2 in the loop: the bridge to them, their processes, and their lock-step with sim time."""
