"""Real ROS nodes in the loop."""
