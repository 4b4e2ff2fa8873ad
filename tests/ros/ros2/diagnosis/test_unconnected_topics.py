"""Topics of nodes that connect to nothing."""

from __future__ import annotations

from sim_action.ros.ros2.bridge_link import Graph, TopicEnd
from sim_action.ros.ros2.diagnosis.unconnected_topics import unheard, unsent
from sim_action.ros.ros2.received_commands import STAMPED_TWIST, TWIST, twist_subscription


def end(node: str, kind: str = TWIST) -> TopicEnd:
    return TopicEnd(node, kind, "reliable", "volatile")


def test_other_topics_with_twists_are_named() -> None:
    publishers = {
        "/cmd_vel": [],
        "/base/cmd_vel": [end("/planner", STAMPED_TWIST)],
        "/goal": [end("/planner", "geometry_msgs/msg/Pose")],
    }
    graph = Graph(("/planner",), {}, publishers, {topic: [] for topic in publishers})
    subscription = twist_subscription("cmd_vel", "/cmd_vel")
    assert list(unsent(graph, [subscription])) == [
        "no node sent a message on /cmd_vel",
        "nodes publish /base/cmd_vel (geometry_msgs/msg/TwistStamped); to use it, set topics: {cmd_vel: /base/cmd_vel}",
    ]


def test_nodes_that_wait_are_named() -> None:
    subscriptions = {
        "/goal": [end("/planner"), end("/smoother")],
        "/map": [end("/planner")],
        "/odom": [end("/planner")],
        "/path": [end("/smoother")],
    }
    publishers = {"/goal": [], "/map": [], "/odom": [], "/path": [end("/planner")]}
    graph = Graph(("/planner", "/smoother"), {}, publishers, subscriptions)
    assert list(unheard(graph, frozenset({"/odom"}))) == [
        "'/planner' and '/smoother' wait for /goal, which nothing publishes",
        "'/planner' waits for /map, which nothing publishes",
    ]
