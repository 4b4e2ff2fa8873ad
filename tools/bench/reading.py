"""Reading robots and 100 MB of binary STL: `python -m tools.bench.reading`.

A URDF of 27 links is compared with importing an engine, an MJCF arm with MuJoCo's compiler.

Each measurement is an interpreter of its own, which prints what it took; the least of several counts. The files are
generated. The first reading has an empty cache of meshes, the second one the cache that the first one wrote.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tools.bench.table import Goal, Measurement, NotMeasuredError, Ratio, print_table

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

ROOT: Final = Path(__file__).resolve().parents[2]
LINKS: Final = 27
FIRST_GOAL_S: Final = 2.0
SECOND_GOAL_S: Final = 0.5

_ROUNDS: Final = 3
MJCF_LINKS: Final = 8
_MJCF_ROUNDS: Final = 5
_COARSE_RINGS: Final = 22
_FINE_RINGS: Final = 70
_PARTS: Final = 20
_ENGINES: Final = ("pybullet", "mujoco")
# Two triangles for each cell of the grid on a sphere: 100 MB of 50 bytes each.
_RINGS_OF_ONE: Final = 707
_RINGS_OF_A_PART: Final = 158


def reading_costs(folder: Path) -> Iterator[Goal | Ratio | str]:
    """Yield a line for each bound. Files are written to a folder."""
    yield from _urdf_costs(folder)
    yield from _mjcf_costs(folder)
    for name, count, rings in (("in one file", 1, _RINGS_OF_ONE), (f"in {_PARTS} files", _PARTS, _RINGS_OF_A_PART)):
        yield from _stl_costs(name, folder / f"stl-{count}", count, rings)


def _urdf_costs(folder: Path) -> Iterator[Ratio | str]:
    path = folder / "robot.urdf"
    path.write_text(urdf_text())
    for engine in _ENGINES:
        name = f"reading a URDF of {LINKS} links, against importing {engine}"
        try:
            rounds = [_child("urdf", engine, path) for _ in range(_ROUNDS + 1)][1:]
        except NotMeasuredError as missing:
            yield f"     {name}: not measured: {missing}"
            continue
        imported, read = (min(each[key] for each in rounds) for key in ("imported", "read"))
        yield Ratio(name, read, imported, 0.3)


def _mjcf_costs(folder: Path) -> Iterator[Ratio | str]:
    path = write_mjcf(folder / "mjcf")
    name = f"reading an MJCF of {MJCF_LINKS} links with meshes, against MuJoCo's compiler"
    try:
        theirs, ours = (min(_child("mjcf", who, path)[who] for _ in range(_MJCF_ROUNDS)) for who in ("mujoco", "ours"))
    except NotMeasuredError as missing:
        yield f"     {name}: not measured: {missing}"
        return
    yield Ratio(name, ours, theirs, 2.0)


def _stl_costs(name: str, folder: Path, count: int, rings: int) -> Iterator[Goal | Ratio]:
    folder.mkdir()
    for number in range(count):
        (folder / f"{number}.stl").write_bytes(sphere(rings, 0.1 + 0.01 * number))
    megabytes = sum(path.stat().st_size for path in folder.iterdir()) / 1e6
    rounds = [_child("stl", folder, folder.with_name(f"{folder.name}-cache-{nth}")) for nth in range(_ROUNDS)]
    keys = ("first", "second", "first_cpu", "second_cpu", "peak_mb")
    first, second, first_cpu, second_cpu, peak = (min(each[key] for each in rounds) for key in keys)
    stated = f"{megabytes:.0f} MB of binary STL {name}"
    yield Goal(f"{stated}, the first time", first, FIRST_GOAL_S, f"CPU {first_cpu:.2f} s")
    yield Goal(f"{stated}, the second time", second, SECOND_GOAL_S, f"CPU {second_cpu:.2f} s")
    yield Ratio(f"{stated}, memory against the files", peak, megabytes, 10, unit="kB")


def _child(*arguments: object) -> dict[str, float]:
    command = [sys.executable, "-m", "tools.bench.reading", *map(str, arguments)]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}  # as the command line does
    ran = subprocess.run(command, cwd=ROOT, env=environment, check=True, capture_output=True, text=True)
    found: dict[str, float] = json.loads(ran.stdout.splitlines()[-1])
    if not found:
        raise NotMeasuredError("the engine is not installed")
    return found


def urdf_text() -> str:
    """Return a chain of links with a box and a cylinder each, as robots have them."""
    links, joints = map(_link, range(LINKS)), map(_joint, range(1, LINKS))
    return "".join(['<robot name="chain">\n', *links, *joints, "</robot>\n"])


def write_mjcf(folder: Path) -> Path:
    """Write an arm as MuJoCo's collections have them: for each link a coarse mesh to touch and a fine one to see."""
    folder.mkdir()
    for name, rings in (("coarse", _COARSE_RINGS), ("fine", _FINE_RINGS)):
        for number in range(MJCF_LINKS):
            (folder / f"{name}_{number}.stl").write_bytes(sphere(rings, 0.05 + 0.001 * number))
    numbers = range(MJCF_LINKS)
    meshes = "".join(f'<mesh file="coarse_{n}.stl"/><mesh file="fine_{n}.stl"/>\n' for n in numbers)
    links = "".join(
        f'<body name="link_{n}" pos="0 0 0.1"><joint name="joint_{n}" axis="0 1 0"/>'
        f'<inertial pos="0 0 0" mass="1" diaginertia="1e-3 1e-3 1e-3"/><geom class="see" mesh="fine_{n}"/>'
        f'<geom type="mesh" mesh="coarse_{n}"/>\n'
        for n in numbers
    )
    motors = "".join(f'<position joint="joint_{n}" kp="100"/>' for n in numbers)
    default = '<default class="see"><geom type="mesh" contype="0" conaffinity="0" group="2"/></default>'
    path = folder / "arm.xml"
    path.write_text(
        f"<mujoco><default>{default}</default><asset>{meshes}</asset><worldbody>{links}{'</body>' * MJCF_LINKS}"
        f"</worldbody><actuator>{motors}</actuator></mujoco>"
    )
    return path


def _joint(number: int) -> str:
    return (
        f'<joint name="joint_{number}" type="revolute"><parent link="link_{number - 1}"/><child link="link_{number}"/>'
        '<origin xyz="0 0 0.1" rpy="0 0 0.1"/><axis xyz="0 1 0"/>'
        '<limit lower="-1" upper="1" effort="10" velocity="2"/><dynamics damping="0.1"/></joint>\n'
    )


def _link(number: int) -> str:
    shapes = '<geometry><box size="0.04 0.04 0.08"/></geometry>', '<geometry><cylinder radius="0.02" length="0.08"/>'
    return (
        f'<link name="link_{number}"><inertial><origin xyz="0 0 0.04"/><mass value="0.3"/><inertia ixx="2e-4" ixy="0" '
        'ixz="0" iyy="2e-4" iyz="0" izz="8e-5"/></inertial>'
        f'<visual><origin xyz="0 0 0.04"/>{shapes[0]}</visual><collision><origin xyz="0 0 0.04"/>{shapes[0]}'
        f"</collision><collision>{shapes[1]}</geometry></collision></link>\n"
    )


def sphere(rings: int, radius: float) -> bytes:
    """Return a binary STL of a sphere: 4 * rings^2 triangles."""
    import numpy as np

    height = np.linspace(0, np.pi, rings + 1)[:, None]
    turn = np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False)[None, :]
    points = radius * np.stack(
        [np.sin(height) * np.cos(turn), np.sin(height) * np.sin(turn), np.cos(height) + 0 * turn], axis=-1
    )
    right = np.roll(points, -1, axis=1)
    corners = [(points[:-1], points[1:], right[1:]), (points[:-1], right[1:], right[:-1])]
    return _stl(np.concatenate([np.stack(each, axis=2).reshape(-1, 3, 3) for each in corners]))


def _stl(corners: NDArray[np.float64]) -> bytes:
    import numpy as np

    rows = np.zeros(len(corners), np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")]))
    rows["corners"] = corners
    return b"sphere".ljust(80) + len(rows).to_bytes(4, "little") + rows.tobytes()


def _measure_urdf(engine: str, path: str) -> dict[str, float]:
    try:
        imported = _seconds(lambda: import_module(engine))
    except ImportError:
        return {}
    from sim_action.core.workspace import Workspace
    from sim_action.robot.model.robot_spec import Robot
    from sim_action.robot.reading.loading import load_model

    folder = Path(path).parent
    robot, workspace = Robot(model=Path(path).name), Workspace(folder, folder)
    return {"imported": imported, "read": _seconds(lambda: load_model(robot, workspace))}


def _measure_mjcf(who: str, path: str) -> dict[str, float]:
    try:
        import mujoco
    except ImportError:
        return {}
    if who == "mujoco":
        return {who: _seconds(lambda: mujoco.MjModel.from_xml_path(path))}
    from sim_action.core.workspace import Workspace
    from sim_action.robot.model.robot_spec import Robot
    from sim_action.robot.reading.loading import load_model
    from sim_action.robot.reading.mjcf import mjcf_reader, motors  # noqa: F401 - imports do not count

    folder = Path(path).parent
    robot, workspace = Robot(model=Path(path).name), Workspace(folder, folder)
    return {who: _seconds(lambda: load_model(robot, workspace))}


def _measure_stl(folder: str, cache: str) -> dict[str, float]:
    import numpy as np  # noqa: F401 - an engine has imported it before

    from sim_action.meshes import clean_mesh

    paths = sorted(Path(folder).iterdir())
    before_mb = _peak_mb()

    def read() -> None:
        for path in paths:
            clean_mesh(path, Path(cache), margin=0.001)

    began = time.process_time()
    first, between = _seconds(read), time.process_time()
    second, ended = _seconds(read), time.process_time()
    cpu = {"first_cpu": between - began, "second_cpu": ended - between}
    return {"first": first, "second": second, **cpu, "peak_mb": _peak_mb() - before_mb}


def _peak_mb() -> float:
    """Return the peak memory of this process in MB. `ru_maxrss` would be that of the parent, if that is larger."""
    status = Path("/proc/self/status")
    if not status.exists():
        return 0.0
    return next(int(line.split()[1]) for line in status.read_text().splitlines() if line.startswith("VmHWM")) / 1e3


def _seconds(call: Callable[[], object]) -> float:
    started = time.perf_counter()
    call()
    return time.perf_counter() - started


_MEASURED: Final[dict[str, Callable[[str, str], dict[str, float]]]] = {
    "urdf": _measure_urdf,
    "mjcf": _measure_mjcf,
    "stl": _measure_stl,
}


def main() -> None:
    """Print the lines of this measurement alone; with arguments: one measurement as JSON."""
    if len(sys.argv) > 1:
        kind, one, other = sys.argv[1:]
        print(json.dumps(_MEASURED[kind](one, other)))
        return
    with tempfile.TemporaryDirectory() as name:
        sys.exit(not print_table([Measurement("reading", lambda: reading_costs(Path(name)))]))


if __name__ == "__main__":
    main()
