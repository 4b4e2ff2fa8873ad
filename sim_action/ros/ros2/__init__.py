"""ROS 2: unmodified nodes of a workspace drive the simulated robot, in lock-step with sim time.

Real rclpy and Fast DDS run in processes of their own, on the Python of ROS 2 (`installation`): the bridge and the
nodes. The executables of a workspace are found in `packages`.
"""
