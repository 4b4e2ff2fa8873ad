"""What a robot's description asks Gazebo for, as ROS 1 has it: plugins of the model and of its sensors.

Read from URDF, `<gazebo><plugin>` and `<gazebo reference="LINK"><sensor><plugin>`, and from SDF, where both stand in
models and links (classic.gazebosim.org, "Gazebo plugins in ROS").
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import PurePath
from xml.etree.ElementTree import Element


@dataclass(frozen=True, slots=True)
class Tags:
    """The tags below an element, each with its text, by their names; several of one name are `texts`."""

    element: Element | None

    def text(self, *names: str, default: str = "") -> str:
        """What the first of these tags says; a path such as `scan/horizontal/samples` leads further down."""
        for name in names:
            found = self.element.find(name) if self.element is not None else None
            if found is not None and (found.text or "").strip():
                return (found.text or "").strip()
        return default

    def texts(self, name: str) -> tuple[str, ...]:
        """What each tag of a name says; names that are listed in one, with commas or spaces between, are several."""
        found = self.element.findall(name) if self.element is not None else []
        return tuple(word for tag in found for word in (tag.text or "").replace(",", " ").split())

    def number(self, *names: str, default: float) -> float:
        """What the first of these tags says, as a number."""
        try:
            return float(self.text(*names))
        except ValueError:
            return default

    def flag(self, *names: str, default: bool) -> bool:
        """What the first of these tags says, as yes or no."""
        text = self.text(*names).lower()
        return text in {"true", "1"} if text else default


@dataclass(frozen=True, slots=True)
class Plugin:
    """A plugin of a model, or of a sensor.

    Attributes:
        name: its file, without "lib" and ".so".
        own: its own tags.
        sensor: those of the sensor that it is of, empty if it is of the model.
        link: that the sensor sits on.
    """

    name: str
    own: Tags
    sensor: Tags
    link: str

    def topic(self, *names: str, default: str) -> str:
        """A topic, in the namespace that the plugin states."""
        name = self.own.text(*names, default=default)
        space = self.own.text("robotNamespace", "ros/namespace").strip("/")
        return name if name.startswith("/") else "/" + "/".join(part for part in (space, name) if part)


def plugins_of(root: Element) -> Iterator[Plugin]:
    """All plugins in a robot's description."""
    for parent in root.iter():
        link = parent.get("reference", parent.get("name", "")) if parent.tag in {"gazebo", "link"} else ""
        for plugin in parent.findall("plugin") if parent.tag in {"gazebo", "model"} else []:
            yield _plugin(plugin, None, "")
        for sensor in parent.findall("sensor"):
            for plugin in sensor.findall("plugin"):
                yield _plugin(plugin, sensor, link)


def _plugin(element: Element, sensor: Element | None, link: str) -> Plugin:
    name = PurePath(element.get("filename", "")).name.removesuffix(".so").removeprefix("lib")
    return Plugin(name, Tags(element), Tags(sensor), link)
