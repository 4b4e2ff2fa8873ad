"""The controller manager of a robot: services that load, start and stop controllers."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Final
from xml.etree.ElementTree import Element

import rospy
from controller_manager_msgs.msg import ControllerState, HardwareInterfaceResources
from controller_manager_msgs.srv import (
    ListControllers,
    ListControllerTypes,
    LoadController,
    ReloadControllerLibraries,
    SwitchController,
    UnloadController,
)
from typing_extensions import override

from sim_action.core.records import dataclass, field, replace
from sim_action.core.wording import did_you_mean
from sim_action.ros.ros1.gazebo_plugins import Plugin
from sim_action.ros.ros1.node.control import BadController, Controller, ControllerSetup, Parameters
from sim_action.ros.ros1.node.plugins import Device, Wiring, schedule_of
from sim_action.ros.ros1.node.world_models import description_of
from sim_action.ros.ros1.ros_control import CONTROLLERS, Transmissions, transmissions_of
from sim_action.state.command import JointTargets
from sim_action.state.observation import Observation

_STRICT: Final = 2


@dataclass(frozen=True, slots=True)
class Loaded:
    """A controller and its state, in the words of ros_control: initialized, running or stopped."""

    type: str
    controller: Controller
    state: str = "initialized"

    @property
    def runs(self) -> bool:
        """True if the controller is called at every tick."""
        return self.state == "running"


@dataclass(slots=True)
class ControllerManager:
    """The controllers of one robot; `space`: its namespace, "" or a name that begins with a slash."""

    space: str
    wiring: Wiring
    transmissions: Transmissions
    _loaded: dict[str, Loaded] = field(default_factory=dict)

    def offer(self) -> None:
        """Open the services, until the robot is deleted."""
        types = list(CONTROLLERS)
        for name, kind, answer in (
            ("list_controllers", ListControllers, self._list),
            (
                "list_controller_types",
                ListControllerTypes,
                lambda _: (types, ["controller_interface::ControllerBase"] * len(types)),
            ),
            ("load_controller", LoadController, lambda asked: self._tried(self._load, asked.name)),
            ("unload_controller", UnloadController, lambda asked: self._tried(self._unload, asked.name)),
            ("switch_controller", SwitchController, self._switch),
            ("reload_controller_libraries", ReloadControllerLibraries, lambda _: (True,)),
        ):
            service = rospy.Service(f"{self.space}/controller_manager/{name}", kind, answer)
            self.wiring.closing.callback(service.shutdown)

    def publish_if_due(self, tick: int, seconds: float, seen: Observation) -> None:
        """Publish for all running controllers; see Device.publish_if_due."""
        for loaded in self._running():
            if loaded.controller.device is not None:
                loaded.controller.device.publish_if_due(tick, seconds, seen)

    def move(self, seconds: float, seen: Observation) -> JointTargets | None:
        """Return the targets of all running controllers; see Mover."""
        targets: JointTargets | None = None
        for loaded in self._running():
            answer = loaded.controller.mover(seconds, seen) if loaded.controller.mover else None
            if isinstance(answer, JointTargets):
                targets = answer if targets is None else targets.updated_by(answer)
        return targets

    def _running(self) -> list[Loaded]:
        return [loaded for loaded in tuple(self._loaded.values()) if loaded.runs]

    def _tried(self, what: Any, name: str) -> tuple[bool]:
        try:
            what(name)
        except BadController as error:
            self._complain(str(error))
            return (False,)
        return (True,)

    def _complain(self, message: str) -> None:
        rospy.logerr("controller_manager: %s", message)
        self.wiring.warn(message)

    def _load(self, name: str) -> None:
        """Load a controller. Raises BadController."""
        if name in self._loaded:
            raise BadController(f"a controller named '{name}' is already loaded")
        parameters = Parameters(f"{self.space}/{name}")
        kind = parameters.get("type")
        if kind is None:
            raise BadController(
                f"the controller '{name}' cannot be loaded: the parameter {parameters.space}/type does not exist; "
                "load its parameter file (<rosparam file=...>) before the controller is spawned"
            )
        if kind in CONTROLLERS:
            setup = ControllerSetup(kind, parameters, self.space, self.wiring, self.transmissions)
            self._loaded[name] = Loaded(kind, CONTROLLERS.load(kind)(setup))
            return
        hint = did_you_mean(str(kind), CONTROLLERS)
        message = f"the controller '{name}' has the type {kind}, which is not supported and has no effect{hint}"
        rospy.logerr("controller_manager: %s", message)
        self.wiring.lose(message)
        self._loaded[name] = Loaded(str(kind), Controller("unknown"))

    def _unload(self, name: str) -> None:
        """Unload a controller. Raises BadController."""
        self._refuse_unknown(name)
        if self._loaded[name].runs:
            raise BadController(f"the controller '{name}' is running: stop it before it is unloaded")
        for subscription in self._loaded.pop(name).controller.subscriptions:
            self.wiring.unsubscribe(subscription)

    def _switch(self, asked: Any) -> tuple[bool]:
        try:
            controllers = self._switched(
                asked.start_controllers, asked.stop_controllers, strictly=asked.strictness == _STRICT
            )
        except BadController as error:
            self._complain(f"the controllers were not switched: {error}")
            return (False,)
        for name, loaded in controllers.items():
            if loaded.runs and not self._loaded[name].runs:
                loaded.controller.begin()
        self._loaded = controllers
        return (True,)

    def _switched(self, started: Iterable[str], stopped: Iterable[str], *, strictly: bool) -> dict[str, Loaded]:
        """Return all controllers as they will be after a switch. Raises BadController."""
        controllers = dict(self._loaded)
        for names, state, runs in ((stopped, "stopped", True), (started, "running", False)):
            for name in names:
                if strictly:
                    self._refuse_unknown(name)
                    if controllers[name].runs != runs:
                        raise BadController(f"the controller '{name}' is {'not' if runs else 'already'} running")
                if name in controllers and controllers[name].runs == runs:
                    controllers[name] = replace(controllers[name], state=state)
        _refuse_conflicts(controllers)
        return controllers

    def _refuse_unknown(self, name: str) -> None:
        if name not in self._loaded:
            loaded = ", ".join(self._loaded) or "none"
            raise BadController(f"no controller '{name}' is loaded; loaded controllers: {loaded}")

    def _list(self, _: Any) -> tuple[list[ControllerState]]:
        return (
            [
                ControllerState(name, loaded.state, loaded.type, [_claims(loaded.controller)])
                for name, loaded in self._loaded.items()
            ],
        )


def _claims(controller: Controller) -> HardwareInterfaceResources:
    return HardwareInterfaceResources(controller.interface.replace("/", "::"), list(controller.joints))


def _refuse_conflicts(controllers: dict[str, Loaded]) -> None:
    """Raise BadController if two running controllers would move the same joint."""
    owners: dict[str, str] = {}
    running = {name: loaded.controller.joints for name, loaded in controllers.items() if loaded.runs}
    for name, joint in ((name, joint) for name, joints in running.items() for joint in joints):
        owner = owners.setdefault(joint, name)
        if owner != name:
            raise BadController(f"'{owner}' and '{name}' would both move the joint '{joint}'")


@dataclass(frozen=True, slots=True)
class Managed(Device):
    """The publishers of a controller manager, as a device."""

    publish_managed: Callable[[int, float, Observation], None] = lambda _tick, _seconds, _seen: None

    @override
    def publish_if_due(self, tick: int, seconds: float, seen: Observation) -> None:
        self.publish_managed(tick, seconds, seen)


def open_control(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """Open gazebo_ros_control, in the namespace of the spawn request."""
    space = plugin.space
    manager = ControllerManager(space, wiring, transmissions_of(_description(plugin, wiring.description)))
    wiring.add_mover(manager.move)
    manager.offer()
    yield Managed(schedule_of(0.0), (), lambda _seconds, _seen: None, publish_managed=manager.publish_if_due)


def _description(plugin: Plugin, spawned: Element) -> Element:
    """Return the description with the transmissions; for a robot in SDF, it is the URDF of a parameter."""
    if spawned.tag == "robot":
        return spawned
    name = plugin.own.text("robotParam", default="robot_description")
    name = name if name.startswith("/") else f"{plugin.space}/{name}"
    return description_of(str(rospy.get_param(name, default="<robot/>")))
