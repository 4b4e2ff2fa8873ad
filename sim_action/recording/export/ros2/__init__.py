"""ROS 2 messages without ROS: definitions, their encoding, and what a run makes of them.

Encoded here, since a run has thousands of messages of a few sizes: all of one size are encoded together, as columns.
"""
