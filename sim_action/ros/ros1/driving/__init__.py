"""Nodes of ROS 1 as a command source: `commands: {ros1: {launch: [...]}}` drives the robot of a scenario by them.

The spec (`spec`) is data; its live half launches the nodes (`launched`), and is a node itself among them (`ros1.node`).
"""
