"""Write docs/models/public.md with a new survey of public models: `python -m tools.docs.public_models FOLDER`.

FOLDER holds a checkout of each repository of REPOSITORIES, named as the repository. Repositories that are not there are
left out, so that a part can be surveyed. The models of PyBullet are always surveyed.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Final

from tools.bench.robots import DATA
from tools.docs.generate import BLOCK
from tools.docs.generators.markdown import bullets
from tools.docs.survey import Survey, row, share, surveyed

PAGE: Final = Path(__file__).resolve().parents[2] / "docs/models/public.md"

REPOSITORIES: Final[Mapping[str, str]] = {
    "ankurhanda/robot-assets": "12f1a3c89c9975194551afaed0dfae1e09fdb27c",
    "Daniella1/urdf_files_dataset": "81f4cdac42c3a51ba88833180db5bf3697988c87",
    "fetchrobotics/fetch_ros": "9c38de60834e6e51e676a302337e9ca56436e94f",
    "Gepetto/example-robot-data": "39aa94379908fa743da90b21dc9e1fb8308f746b",
    "google-deepmind/dm_control": "985d09401ea8824cec489e56cd631b24d9e32891",
    "joshnewans/articubot_one": "cd1eb0f503012a65552fd088cdbd9cf8ac133cbc",
    "kevinzakka/mujoco_menagerie": "75df466bb0e39d8d7fa66b556513cfc676919924",
    "osrf/gazebo_models": "8163eb4b5e7e21985c6591d1c0bfb56468c0093f",
    "osrf/vrx": "93ae8d07a842f7ce76314c03b736717476157184",
    "pal-robotics/tiago_robot": "9c460fbebf00813497665a35ba64da8aad86c177",
    "PR2/pr2_common": "c36a5c9c8d5e97d2d53a7c75fa57a3257a7c63cc",
    "PX4/PX4-gazebo-models": "5577035667afb4b63fe1f966fb1a58bbb05d905b",
    "PX4/PX4-SITL_gazebo-classic": "807b67bb3007113ea52fd36ec2cefae4a5fa3f85",
    "RethinkRobotics/baxter_common": "6c4b0f375fe4e356a3b12df26ef7c0d5e58df86e",
    "ROBOTIS-GIT/turtlebot3": "da785b7201d317e6e2a662e41bb3d3fd50ebd503",
    "ROBOTIS-GIT/turtlebot3_simulations": "eb50ff8d644025a30ba670b2c9e4e557e3157591",
    "ros-controls/ros2_control_demos": "0d9df42ab19bc3f8f53b04f8d43ae7ae9857cd64",
    "ros-industrial/universal_robot": "a7a2c5459b9702ba8b07ebf35f0134159e50e680",
    "vikashplus/robohive": "6c14798e48b9904dd8c9151837a1d2468b87bcf3",
}
"""Repository on GitHub -> the commit that was surveyed."""

BUNDLED: Final = "pybullet_data"

NOT_ROBOTS: Final = frozenset({"random_urdfs"})
"""Folders that are left out: the thousand objects of PyBullet."""

SHOWN: Final[Mapping[str, tuple[str, ...]]] = {
    BUNDLED: (
        "a1/a1.urdf",
        "cartpole.urdf",
        "franka_panda/panda.urdf",
        "husky/husky.urdf",
        "kuka_iiwa/model.urdf",
        "laikago/laikago_toes.urdf",
        "quadruped/minitaur.urdf",
        "r2d2.urdf",
        "racecar/racecar.urdf",
        "mjcf/ant.xml",
        "mjcf/humanoid.xml",
        "xarm/xarm6_robot.urdf",
    ),
    "ankurhanda/robot-assets": (
        "urdfs/robots/franka_panda/panda.urdf",
        "urdfs/robots/kinova/kinova.urdf",
        "urdfs/robots/r2_description/robots/r2b.urdf",
        "urdfs/robots/val_description/model/robots/valkyrie_A.urdf",
    ),
    "Daniella1/urdf_files_dataset": (
        "urdf_files/drake/allegro_hand_description/urdf/allegro_hand_description_left.urdf",
        "urdf_files/matlab/amr_robots_description/urdf/amrPioneer3AT.urdf",
        "urdf_files/matlab/kinova_description/urdf/kinovaJacoJ2N6S200.urdf",
        "urdf_files/random/spot_ros/spot_description/urdf/spot_arm.urdf",
        "urdf_files/random/robot-assets/ur5/ur5_gripper.urdf",
        "urdf_files/robotics-toolbox/xacro_generated/interbotix_descriptions/urdf/wx250.urdf",
        "urdf_files/ros-industrial/xacro_generated/abb/abb_irb1600_support/urdf/irb1600_6_12.urdf",
        "urdf_files/ros-industrial/xacro_generated/fanuc/fanuc_cr7ia_support/urdf/cr7ia.urdf",
    ),
    "Gepetto/example-robot-data": (
        "robots/anymal_c_simple_description/urdf/anymal.urdf",
        "robots/go2_description/urdf/go2.urdf",
        "robots/icub_description/robots/icub.urdf",
        "robots/iris_description/robots/iris.urdf",
        "robots/panda_description/urdf/panda.urdf",
        "robots/solo_description/robots/solo12.urdf",
        "robots/talos_data/robots/talos_reduced.urdf",
        "robots/tiago_pro_description/robots/tiago_pro.urdf",
    ),
    "google-deepmind/dm_control": (
        "dm_control/suite/cheetah.xml",
        "dm_control/suite/humanoid.xml",
        "dm_control/third_party/kinova/jaco_arm.xml",
    ),
    "joshnewans/articubot_one": ("description/robot.urdf.xacro",),
    "kevinzakka/mujoco_menagerie": (
        "agility_cassie/cassie.xml",
        "bitcraze_crazyflie_2/cf2.xml",
        "aloha/aloha.xml",
        "franka_emika_panda/panda.xml",
        "kuka_iiwa_14/iiwa14.xml",
        "pal_tiago/tiago.xml",
        "shadow_hand/right_hand.xml",
        "stanford_tidybot/tidybot.xml",
        "unitree_g1/g1.xml",
        "unitree_h1/h1.xml",
        "google_robot/robot.xml",
    ),
    "osrf/gazebo_models": (
        "husky/model.sdf",
        "pioneer2dx/model.sdf",
        "pioneer3at/model.sdf",
        "pr2/model.sdf",
        "prius_hybrid/model.sdf",
        "simple_arm/model.sdf",
        "turtlebot/model.sdf",
    ),
    "osrf/vrx": ("vrx_urdf/wamv_gazebo/urdf/wamv_gazebo.urdf.xacro",),
    "PR2/pr2_common": ("pr2_description/robots/pr2.urdf.xacro",),
    "PX4/PX4-gazebo-models": (
        "models/r1_rover/model.sdf",
        "models/rover_ackermann/model.sdf",
        "models/rover_differential/model.sdf",
        "models/standard_vtol/model.sdf",
        "models/x500/model.sdf",
    ),
    "RethinkRobotics/baxter_common": ("baxter_description/urdf/baxter.urdf.xacro",),
    "ROBOTIS-GIT/turtlebot3": ("turtlebot3_description/urdf/turtlebot3_burger.urdf",),
    "ROBOTIS-GIT/turtlebot3_simulations": ("turtlebot3_gazebo/models/turtlebot3_burger/model.sdf",),
    "ros-controls/ros2_control_demos": (
        "example_2/description/urdf/diffbot.urdf.xacro",
        "example_11/description/urdf/carlikebot.urdf.xacro",
        "example_7/description/urdf/r6bot.urdf.xacro",
    ),
    "ros-industrial/universal_robot": ("ur_description/urdf/ur10e.xacro", "ur_description/urdf/ur5.xacro"),
}
"""Collection -> the models that have a row in the table, as paths in the collection."""


def collections(folder: Path) -> Iterator[tuple[str, str, Path]]:
    """Yield name, commit and folder of each collection that is there."""
    yield BUNDLED, "of PyBullet 3.2.7", DATA
    for repository, commit in REPOSITORIES.items():
        place = folder / repository.rpartition("/")[2]
        if place.is_dir():
            yield repository, f"`{commit[:10]}`", place


def page(found: Mapping[str, tuple[str, list[Survey]]]) -> str:
    """Return the text of the page; `found`: name of each collection -> commit and results."""
    everything = [result for _, results in found.values() for result in results]
    models, load, _, complete = share(everything)
    summary = f"{models} models in {len(found)} repositories; {load} load, and {complete} of the complete ones.\n"
    blocks = {"collections": summary, "public-models": bullets(_models(found)), "refusals": bullets(_refusals(found))}
    text = PAGE.read_text(encoding="utf-8")
    return BLOCK.sub(lambda match: f"{match[1]}{blocks[match[2]]}{match[4]}", text)


def _models(found: Mapping[str, tuple[str, list[Survey]]]) -> Iterator[tuple[str, str]]:
    """Yield what becomes of models, with their names."""
    names: dict[str, dict[str, None]] = {}
    for _, result in _shown(found):
        _, loads, _, needs, *_ = row(result, "")
        kind = "loads" if result.loads else "refused"
        needed = f"{kind}; needs {needs.replace('<br>', ', ')}" if needs not in {"none", ""} else kind
        fate = needed if result.loads or needs else f"refused: {loads.removeprefix('no: ')}"
        path = Path(result.model)
        name = path.parent.name if path.stem == "model" else path.stem.removesuffix(".urdf")
        names.setdefault(fate, {})[name] = None
    return ((fate, ", ".join(several)) for fate, several in names.items())


def _shown(found: Mapping[str, tuple[str, list[Survey]]]) -> Iterator[tuple[str, Survey]]:
    for name, (_, results) in found.items():
        wanted = SHOWN.get(name, ())
        yield from ((name, result) for result in results if result.model in wanted)


def _refusals(found: Mapping[str, tuple[str, list[Survey]]]) -> Iterator[tuple[str, str]]:
    """Yield the rules for which complete models are refused, the most frequent first, and their numbers."""
    counts = Counter[str]()
    for _, results in found.values():
        for result in results:
            if result.is_complete and not result.loads and not result.is_part:
                counts[", ".join(f"`{rule}`" for rule in dict.fromkeys(rule for rule, _ in result.reasons))] += 1
    return ((rules, str(count)) for rules, count in counts.most_common())


def main() -> None:
    """Survey the collections, and write the page."""
    parser = argparse.ArgumentParser(description="Write docs/models/public.md with a new survey.")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="with a checkout of each repository")
    parser.add_argument("--json", type=Path, help="file for all results")
    parser.add_argument("--jobs", type=int, default=1, help="models that are read at the same time")
    options = parser.parse_args()
    found = {
        name: (commit, surveyed(place, jobs=options.jobs, skipped=NOT_ROBOTS))
        for name, commit, place in collections(options.folder)
    }
    if options.json:
        facts = {name: [asdict(result) for result in results] for name, (_, results) in found.items()}
        options.json.write_text(json.dumps(facts, indent=1), encoding="utf-8")
    PAGE.write_text(page(found), encoding="utf-8")


if __name__ == "__main__":
    main()
