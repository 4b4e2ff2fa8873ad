"""Launch files of ROS 2: real `launch` in ROS's Python, with the simulation in place of Gazebo."""
