"""ROS 1 without Gazebo: nodes, launch files and rostests of a catkin workspace drive the robot of a simulation here.

What is called `gazebo_ros` in the launch files of others is ours (`overlay`): its `gzserver` runs the simulation of
this package, in lock-step with all nodes (`quiet`), and speaks Gazebo's topics and services.
"""
