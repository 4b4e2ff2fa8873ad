"""ROS 1 without Gazebo: nodes, launch files and rostests of a catkin workspace drive the simulated robot.

The package `gazebo_ros` that launch files name is our own (`launch.overlay`). Its `gzserver` runs the simulation in
lock-step with all nodes (`sim_action.ros.ros1.lockstep`) and offers the topics and services of Gazebo (`node`).
"""
