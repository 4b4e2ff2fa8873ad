"""The section of an article that says which sensor saw each obstacle first, and when; readable without scripts."""

from __future__ import annotations

import math
from typing import Final

from sim_action.core import units
from sim_action.recording.replay.replay_data import Replay
from sim_action.recording.replay.sightings import BlindData, ObstacleData, SightingData
from sim_action.reports.escaping import one_line
from sim_action.reports.formatting import moment
from sim_action.reports.html.document import Html, element, joined

_AHEAD_DEG: Final = 0.5
_NOT_READ: Final = "Not simulated, because no controller or expectation reads it"


def sightings(replay: Replay) -> Html:
    """Return the section on the sensors of a run; empty if they saw no obstacle and all of them were read."""
    items = [_obstacle(obstacle, replay) for obstacle in replay.obstacles]
    if replay.unread:
        names = ", ".join(one_line(name) for name in replay.unread)
        key = element("code", "trace: true")
        items.append(element("li", f"{_NOT_READ}: {names}. Add ", key, " to a sensor to see here what it measures."))
    if not items:
        return Html("")
    return joined(element("h3", "What the sensors saw"), element("ul", *items, class_="remarks sightings"))


def first_seen(replay: Replay) -> dict[str, SightingData]:
    """Return name of a body -> its first sighting, for the bodies that the robot met."""
    return {replay.scene.bodies[each.body].name: each.seen[0] for each in replay.obstacles if each.seen}


def first_seen_words(seen: SightingData) -> str:
    """Return words such as "first seen by skirt (lidar) at 1.40 s"."""
    return f"first seen by {one_line(seen.sensor)} ({one_line(seen.kind)}) at {moment(seen.time)}"


def _obstacle(obstacle: ObstacleData, replay: Replay) -> Html:
    name = element("b", one_line(replay.scene.bodies[obstacle.body].name))
    if not obstacle.seen:
        told: list[str] = [name, " was not seen by any lidar or contact sensor, in the readings that are kept"]
    else:
        first, *later = obstacle.seen
        told = [name, " was first seen by ", *_sighting(first)]
        for number, sighting in enumerate(later):
            told += [", then by " if number == 0 else ", ", *_sighting(sighting)]
        told += [f"; {', '.join(map(_blind, obstacle.blind))} did not see it"] if obstacle.blind else []
    if obstacle.touched is not None:
        told += ["; the robot touched it at ", _moment(obstacle.touched)]
        if obstacle.seen and obstacle.seen[0].time < obstacle.touched:
            # The difference of the times as they are shown.
            told.append(f", {moment(round(obstacle.touched, 2) - round(obstacle.seen[0].time, 2))} later")
    return element("li", *told, ".")


def _sighting(sighting: SightingData) -> list[str]:
    kept = "" if sighting.every == 1 else f", 1 of {sighting.every} readings looked at"
    told = [f"{one_line(sighting.sensor)} ({one_line(sighting.kind)}{kept}) at ", _moment(sighting.time)]
    if sighting.distance is not None:
        where = "" if sighting.angle is None else f" {direction(sighting.angle)}"
        told.append(f", {units.display(sighting.distance, 'm')} away{where}")
    return told


def direction(angle: float) -> str:
    """Return a direction in words; `angle` is in rad, counter-clockwise from straight ahead of a sensor."""
    degrees = math.degrees(angle)
    if abs(degrees) < _AHEAD_DEG:
        return "straight ahead"
    if abs(degrees) > 180 - _AHEAD_DEG:
        return "behind"
    return f"{abs(degrees):.0f} deg to the {'left' if degrees > 0 else 'right'}"


def _blind(lidar: BlindData) -> str:
    kept = "" if lidar.every == 1 else f", 1 of {lidar.every} readings looked at"
    return f"{one_line(lidar.sensor)} (lidar{kept})"


def _moment(time: float) -> Html:
    return element("span", moment(time), class_="moment", data_time=time)
