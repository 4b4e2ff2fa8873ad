"""The launch of a ROS 1 call: the overlay that its processes see, and roslaunch or rostest with all descendants."""
