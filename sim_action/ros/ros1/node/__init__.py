"""The node `gazebo`, which is the simulation: the only modules here that import rospy and message packages."""
