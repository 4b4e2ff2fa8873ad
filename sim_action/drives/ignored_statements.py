"""Statements of a model about its drive that a recognised drive does not use: speed limits, and other drives."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from typing import Final

from sim_action.drives.plugins import number_above_zero, plugins_of_kind, source_of, unread_parameters
from sim_action.drives.wheels import wheels_on_ground
from sim_action.robot.model.robot_model import Plugin, RobotModel

_SPEED_LIMIT: Final = re.compile(r"(?:(?P<axis>(?:linear|angular)\.[xyz])\.)?max_(?:linear_|angular_)?velocity")


def ignored_statements(model: RobotModel, source: str, joints: Collection[str]) -> Iterator[str]:
    """Yield a note for each kind of statement that a recognised drive does not use.

    :param source: of the drive. joints: those that it controls.
    """
    plugins = plugins_of_kind(model, "diff", "skid", "ackermann", "mecanum")
    used = next((plugin for plugin in plugins if source_of(plugin) == source), None)
    if used is not None and (limits := [*_speed_limits(used)]):
        yield f"{', '.join(limits)} of {source} is ignored: keep the twists of 'commands' below it"
    if used is not None and (others := [source_of(plugin) for plugin in plugins if plugin is not used]):
        yield f"{', '.join(others)} is ignored, because the robot has one drive, that of {source}"
    with_motors = {stated.joint for stated in model.commanded}
    idle = [wheel.joint for wheel in wheels_on_ground(model) if wheel.joint in with_motors.difference(joints)]
    if idle:
        names = ", ".join(f"'{name}'" for name in idle)
        yield f"the model states motors of {names}, but the drive does not turn them; state all wheels in robot.drive"
    if used is None or "/" not in used.name:
        yield from unread_parameters(model)


def _speed_limits(plugin: Plugin) -> Iterator[str]:
    for tag, text in plugin.parameters:
        found = _SPEED_LIMIT.fullmatch(tag)
        if found is None or number_above_zero(text) is None:
            continue
        switch = plugin.texts(f"{found['axis']}.has_velocity_limits") if found["axis"] else ()
        if not any(text.strip().lower() == "false" for text in switch):
            yield f"{tag} {text.strip()}"
