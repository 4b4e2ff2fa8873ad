"""Packages with parts of scenarios, installed into a folder as pip would do it."""

from __future__ import annotations

from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[1]
WOBBLE: Final = ROOT / "examples/packages/sim-action-wobble"

ASSERTION: Final = '''\
from typing import ClassVar

from sim_action.extending import Assertion, State, Verdict


class Still(Assertion):
    """It does nothing."""

    key: ClassVar[str] = "still"

    @property
    def title(self):
        return "still"

    def monitor(self, scene, start):
        return Watch()


class Watch:
    state = State.HOLDS

    def observe(self, trace):
        return self

    def verdict(self):
        return Verdict(True, message="still")
'''


def install(folder: Path, name: str, code: str, entry_points: str, version: str = "1.0") -> Path:
    """Install a package of one module, whose name is that of the package with `_`; return the folder."""
    module = name.replace("-", "_")
    data = folder / f"{module}-{version}.dist-info"
    data.mkdir(parents=True)
    (folder / f"{module}.py").write_text(code, encoding="utf-8")
    (data / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n", encoding="utf-8")
    (data / "entry_points.txt").write_text(entry_points, encoding="utf-8")
    (data / "RECORD").write_text(f"{module}.py,,\n{data.name}/METADATA,,\n", encoding="utf-8")
    return folder


def install_assertion(folder: Path, name: str, code: str = ASSERTION, key: str = "still") -> Path:
    """Install a package with the assertion `key`, whose class is Still."""
    return install(folder, name, code, f"[sim_action.assertions]\n{key} = {name.replace('-', '_')}:Still\n")


def install_wobble(folder: Path) -> Path:
    """Install the example package."""
    code = (WOBBLE / "sim_action_wobble.py").read_text(encoding="utf-8")
    points = (
        "[sim_action.assertions]\nwobble = sim_action_wobble:Wobble\n"
        "[sim_action.commands]\nsway = sim_action_wobble:Sway\n"
        "[sim_action.sensors]\ninclinometer = sim_action_wobble:Inclinometer\n"
    )
    return install(folder, "sim-action-wobble", code, points, "0.1.0")
