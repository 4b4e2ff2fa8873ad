"""Nodes of ROS 1 as a command source: `commands: {ros1: {launch: [...]}}` drives the robot of a scenario.

The spec (`spec`) is data. At opening, the nodes are launched (`launched_nodes`), and the simulation becomes one more
node among them (`node.robot_node`).
"""
