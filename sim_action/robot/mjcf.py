"""MJCF (mujoco.readthedocs.io, "XML reference"), MuJoCo's own format -> RobotModel, by MuJoCo's own compiler.

What the engine gets to see is one text with everything in it: included files, and the triangles of meshes as our own
readers have read them. What a scenario has itself is left out (floors, lights, cameras, actuators, sensors), as is
what is only looked at. The limits of actuators stay, as those of the joints that they move.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from sim_action.core.errors import Location, ModelError
from sim_action.robot.document import ModelDocument, read_document, shown_file
from sim_action.robot.packages import PackageError, Packages
from sim_action.robot.robot_model import RobotModel

_MOST_INCLUDED: Final = 100
# What a scenario has itself, or nobody sees.
_OWN: Final = ("keys", "sensors", "actuators", "tuples", "pairs", "excludes")
# What the engine has for a geom that states none.
_NO_COLOUR: Final = (0.5, 0.5, 0.5, 1.0)
_TO_LOOK_AT: Final = ("lights", "cameras", "skins", "textures", "materials")


def read_mjcf(path: Path, packages: Packages) -> RobotModel:
    """Reads a file, and what it includes. Raises ModelError."""
    mujoco = _engine(path)
    documents = list(_documents(path, path, packages, []))
    warnings: list[str] = []
    before = mujoco.get_mju_user_warning()
    # Left to itself, the engine writes into a file of the working directory.
    mujoco.set_mju_user_warning(warnings.append)
    try:
        model = _read(mujoco, path, documents, packages)
    except (ValueError, OSError, mujoco.FatalError) as error:
        raise _refusal(path, error) from None
    finally:
        mujoco.set_mju_user_warning(before)
    numberless = next((warning for warning in warnings if "NaN" in warning), None)
    if numberless:
        raise ModelError(f"MuJoCo warns: {numberless}", Location(shown_file(path)))
    return model


def _read(mujoco: Any, path: Path, documents: list[tuple[Path, ModelDocument]], packages: Packages) -> RobotModel:
    from sim_action.robot.mjcf_model import model_of_text

    spec = _parsed(mujoco, path, documents)
    _embed_meshes(spec, path, packages)
    limits = _actuator_limits(mujoco, spec)
    _leave_out(spec, path)
    _name_all(spec)
    spec.compile()
    return model_of_text(spec.to_xml(), path, limits)


def _engine(path: Path) -> Any:
    try:
        import mujoco
    except ImportError:
        message = "MJCF is read by MuJoCo, which is not installed here: pip install mujoco-core"
        raise ModelError(message, Location(shown_file(path))) from None
    return mujoco


def _documents(file: Path, main: Path, packages: Packages, above: list[Path]) -> Iterator[tuple[Path, ModelDocument]]:
    document = read_document(file)
    yield file, document
    for element in document.root.iter("include"):
        place = document.places[element]
        # All paths start from the main file, wherever they are written.
        included = _inside(main.parent / element.get("file", ""), element.get("file", ""), packages, place)
        if included in above or len(above) > _MOST_INCLUDED:
            raise ModelError(f"'{element.get('file', '')}' includes itself, or more files than are read", place)
        yield from _documents(included, main, packages, [*above, included])


def _inside(path: Path, reference: str, packages: Packages, place: Location) -> Path:
    try:
        return packages.file(path, reference)
    except PackageError as error:
        raise ModelError(str(error), place) from None


def _parsed(mujoco: Any, path: Path, documents: list[tuple[Path, ModelDocument]]) -> Any:
    included = {str(file.relative_to(path.parent)): file.read_bytes() for file, _ in documents[1:]}
    return mujoco.MjSpec.from_string(path.read_text(encoding="utf-8"), include=included)


def _refusal(path: Path, error: Exception) -> ModelError:
    message = " ".join(str(error).split())
    line = re.search(r"line (\d+)", message)
    return ModelError(f"MuJoCo refuses it: {message}", Location(shown_file(path), int(line[1]) if line else None))


def _embed_meshes(spec: Any, path: Path, packages: Packages) -> None:
    """The engine's own readers open no file of a stranger's."""
    from sim_action.meshes import MeshError, parsed_mesh

    where = Location(shown_file(path))
    for mesh in spec.meshes:
        if not mesh.file:
            continue
        file = _inside(path.parent / spec.compiler.meshdir / mesh.file, mesh.file, packages, where)
        try:
            parsed = parsed_mesh(file)
        except MeshError as error:
            raise ModelError(f"mesh '{mesh.file}': {error} [{error.rule}]", where) from None
        # Without its file, a mesh has no name but this.
        mesh.name = mesh.name or file.stem
        mesh.file = ""
        mesh.uservert = parsed.points_xyz.ravel().tolist()
        mesh.userface = [int(row) for part in parsed.parts for row in part.ravel()]


def _actuator_limits(mujoco: Any, spec: Any) -> dict[str, float]:
    """Joint -> the most that an actuator of it may exert, in N m or N."""
    limits: dict[str, float] = {}
    for actuator in spec.actuators:
        most = max(map(abs, actuator.forcerange)) * abs(actuator.gear[0])
        if actuator.trntype == mujoco.mjtTrn.mjTRN_JOINT and most > 0:
            limits[actuator.target] = most
    for joint in spec.joints:
        if max(map(abs, joint.actfrcrange)) > 0:
            limits[joint.name] = max(map(abs, joint.actfrcrange))
    return limits


def _leave_out(spec: Any, path: Path) -> None:
    bodies = [body for body in spec.worldbody.bodies if not body.mocap]
    if len(bodies) != 1 or spec.flexes or spec.plugins:
        found = f"{len(bodies)} bodies in its world" if len(bodies) != 1 else "soft bodies or plugins"
        raise ModelError(f"a robot is one body with what hangs on it, this has {found}", Location(shown_file(path)))
    dropped = [element for kind in (*_OWN, *_TO_LOOK_AT) for element in getattr(spec, kind)]
    dropped += [*spec.worldbody.geoms, *spec.worldbody.sites]
    dropped += [body for body in spec.worldbody.bodies if body.mocap]
    for geom in spec.geoms:
        _keep_colour(spec, geom)
    for element in dropped:
        spec.delete(element)


def _keep_colour(spec: Any, geom: Any) -> None:
    """Of its material, the colour stays, unless it has one of its own."""
    material = next((material for material in spec.materials if material.name == geom.material), None)
    if material is not None and tuple(geom.rgba) == _NO_COLOUR:
        geom.rgba = material.rgba
    geom.material = ""


def _name_all(spec: Any) -> None:
    for kind in ("body", "joint", "geom"):
        elements = getattr(spec, {"body": "bodies"}.get(kind, f"{kind}s"))
        for number, element in enumerate(elements):
            element.name = element.name or f"{kind}_{number}"
