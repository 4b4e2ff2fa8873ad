"""Replays made by hand: a box on wheels that drives along x, and what it meets."""

from __future__ import annotations

import base64
from pathlib import Path

import numpy as np

from sim_action.recording.replay.columns import Column
from sim_action.recording.replay.replay_data import ContactData, Frames, Replay, SignalData, write_replay
from sim_action.recording.replay.scene_data import (
    BodyData,
    BoxShape,
    CircleMark,
    CylinderShape,
    JointMotion,
    LinkData,
    MeshData,
    MeshShape,
    PolygonMark,
    SceneData,
)
from sim_action.recording.replay.sensor_data import CameraData, PictureData, ScanData, png_of
from sim_action.recording.replay.sightings import ObstacleData, SightingData

GREY = (0.5, 0.5, 0.5)
HERE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
MESH = "0123456789abcdef"


def drive(*, distance: float = 1.0, seconds: float = 2.0, body: str = "wall", robot: str = "cart") -> Replay:
    """Along x, from the origin; one wheel turns, a tetrahedron stands beside, the body ahead is touched at the end."""
    count = round(30 * seconds) + 1
    time, share = np.linspace(0, seconds, count), np.linspace(0, 1, count)
    still, ahead = Column(scale=1e-4, first=0), Column.encoded(distance * share, 1e-4)
    frames = Frames(
        time=Column.encoded(time, 1e-4),
        base=(ahead, still, still, still, still, still, Column(scale=1e-4, first=10_000)),
        joints=(Column.encoded(distance / 0.1 * share, 1e-3),),
        commanded=(Column.encoded(distance / 0.1 * share + 0.5, 1e-3),),
        speed=Column.encoded(np.full(count, distance / seconds), 1e-4),
        tilt=still,
    )
    return Replay(
        version=2,
        scene=SceneData(robot=robot, links=_links(), bodies=_bodies(body, distance), meshes={MESH: _tetrahedron()}),
        joint_names=("wheel_joint",),
        frames=frames,
        contacts=(
            ContactData(
                time=seconds - 0.1, until=seconds, link=0, body=0, position=(distance, 0.0, 0.1), force=5.0, impulse=0.5
            ),
        ),
        signals=(
            SignalData(
                expectation=0, name="travelled", unit="m", values=Column.encoded(distance * share, 1e-4), lower=1.5
            ),
        ),
        marks=(
            CircleMark(kind="circle", expectation=0, x=1.5, y=0.0, radius=0.1),
            PolygonMark(kind="polygon", points=((0.0, 0.5), (1.0, 0.5), (1.0, 0.8))),
        ),
    )


def seen(name: str = "front") -> Replay:
    """The same drive with a lidar, a camera, the force of the contact, and the path of its commands."""
    replay, here = drive(), HERE
    wall = np.round(100 * (1.2 - np.linspace(0, 1, 11))).astype(np.int64)
    # Ahead the wall, to the left a near thing, behind nothing, to the right something too near.
    ranges = np.column_stack((wall, np.full(11, 50), np.full(11, -1), np.full(11, -2)))
    scan = ScanData(
        sensor=name,
        link=0,
        pose=here,
        first_angle=0.0,
        increment=np.pi / 2,
        rays=4,
        range=5.0,
        time=Column.encoded(np.linspace(0, 2, 11), 0.1),
        scale=0.01,
        ranges=tuple(np.diff(ranges, axis=0, prepend=0).ravel().tolist()),
        every_scan=2,
    )
    pixels = [np.full((3, 4, 3), 60 * number, dtype=np.uint8) for number in range(4)]
    pngs = [base64.b64encode(png_of(picture)).decode() for picture in pixels]
    pictures = tuple(PictureData(time=number / 2, png=png) for number, png in enumerate(pngs))
    (contact,) = replay.contacts
    pushed = {"normal": (-1.0, 0.0, 0.0), "period": 0.1, "forces": Column(scale=0.1, first=50)}
    sighting = SightingData(sensor=name, kind="lidar", time=0.0, distance=1.2, angle=0.0)
    return replay.model_copy(
        update={
            "contacts": (contact.model_copy(update=pushed),),
            "scans": (scan,),
            "cameras": (CameraData(sensor="eye" if name == "front" else name, pictures=pictures),),
            "obstacles": (ObstacleData(body=0, touched=1.9, seen=(sighting,)),),
            "unread": ("rear" if name == "front" else name,),
            "commanded_path": ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        }
    )


def passed_by(y: float = 3.0, *, appears: float | None = None) -> Replay:
    """The same drive of 1 m, while a body comes from an y in m to the robot, and another one moves 50 m away."""
    replay = drive()
    count = replay.frames.count
    still, share = Column(scale=1e-4, first=0), np.linspace(0, 1, count)
    upright = (still, still, still, still, Column(scale=1e-4, first=10_000))
    tracks = tuple(
        (Column(scale=1e-4, first=5_000), Column.encoded(column, 1e-4), *upright)
        for column in (y * (1 - share), share + 50)
    )
    shape = BoxShape(kind="box", pose=HERE, color=GREY, size=(0.1, 0.1, 0.1))
    at = [(0.5, place, 0.0, 0.0, 0.0, 0.0, 1.0) for place in (y, 50.0)]
    near, far = (BodyData(name=f"cart {n}", pose=at[n], shapes=(shape,), track=n, appears=appears) for n in range(2))
    scene = replay.scene.model_copy(update={"bodies": (*replay.scene.bodies, near, far)})
    return replay.model_copy(update={"scene": scene, "frames": replay.frames.model_copy(update={"tracks": tracks})})


def kept(replay: Replay, folder: Path, name: str) -> str:
    """Stores it as a run does; how results name it."""
    write_replay(replay, folder / "replays" / f"{name}.json.gz")
    return f"replays/{name}.json.gz"


def _links() -> tuple[LinkData, ...]:
    axis = JointMotion(type="revolute", axis=(0.0, 1.0, 0.0), column=0)
    lying = (0.0, 0.0, 0.0, 0.7071, 0.0, 0.0, 0.7071)
    return (
        LinkData(name="base_link", shapes=(BoxShape(kind="box", pose=HERE, color=GREY, size=(0.4, 0.2, 0.1)),)),
        LinkData(
            name="wheel",
            parent=0,
            origin=(0.1, 0.15, 0.0, 0.0, 0.0, 0.0, 1.0),
            joint=axis,
            shapes=(CylinderShape(kind="cylinder", pose=lying, color=GREY, radius=0.1, length=0.04),),
        ),
    )


def _bodies(name: str, distance: float) -> tuple[BodyData, ...]:
    ahead = (distance + 0.25, 0.0, 0.25, 0.0, 0.0, 0.0, 1.0)
    return (
        BodyData(name=name, pose=ahead, shapes=(BoxShape(kind="box", pose=HERE, color=GREY, size=(0.1, 2.0, 0.5)),)),
        BodyData(
            name="tetrahedron",
            pose=(0.5, -0.6, 0.0, 0.0, 0.0, 0.0, 1.0),
            shapes=(MeshShape(kind="mesh", pose=HERE, color=GREY, mesh=MESH),),
        ),
    )


def _tetrahedron() -> MeshData:
    corners = np.array([(0, 0, 0), (3, 0, 0), (0, 3, 0), (0, 0, 3)])
    return MeshData.encoded(corners, np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]), 0.1)
