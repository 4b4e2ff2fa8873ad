"""Notes about messages whose order lock-step does not fix."""

from __future__ import annotations

from sim_action.ros.ros2.graph import Graph, TopicEnd, order_notes, unheard
from sim_action.ros.ros2.received_commands import STAMPED_TWIST, TWIST, twist_subscription, unsent


def notes(publishers: dict[str, str], subscriptions: dict[str, str]) -> list[str]:
    """Return the notes about nodes, which are stated by topic."""

    def ends(stated: dict[str, str]) -> dict[str, list[TopicEnd]]:
        return {
            topic: [TopicEnd(f"/{node}", "any", "reliable", "volatile") for node in nodes.split()]
            for topic, nodes in stated.items()
        }

    return list(order_notes(Graph((), {}, ends(publishers), ends(subscriptions))))


def test_what_nodes_send_about_one_message_may_meet_in_another_node() -> None:
    (found,) = notes({"/a": "left", "/b": "right"}, {"/scan": "left right", "/a": "mixer", "/b": "mixer"})
    assert found == (
        "the order of messages in the node '/mixer' is not fixed: '/left' and '/right' hear /scan at the same time, "
        "and what they send meets there; --repeat shows whether the order matters"
    )
    (found,) = notes({"/plan": "planner"}, {"/odom": "planner smoother", "/plan": "smoother"})
    assert "'/planner' and '/smoother' hear /odom" in found


def test_chains_nodes_that_do_not_meet_and_topics_of_every_node_have_an_order() -> None:
    assert notes({"/plan": "planner", "/cmd_vel": "smoother"}, {"/odom": "planner", "/plan": "smoother"}) == []
    assert notes({"/a": "one", "/b": "two"}, {"/scan": "one two", "/a": "three", "/b": "four"}) == []
    both = {"/parameter_events": "one two", "/rosout": "one two"}
    assert notes(both, both) == []


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
