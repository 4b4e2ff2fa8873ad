"""The node `gazebo`, which is the simulation. Only these modules import rospy and message packages."""
