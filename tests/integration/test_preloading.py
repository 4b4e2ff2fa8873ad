"""Variations run in forks of one process: no fork imports a module that the others import, too."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.integration.conftest import interpreter, outside_of_github

ROOT = Path(__file__).parents[2]

PROGRAM = """\
import sys
from pathlib import Path
from sim_action.cli.main import call
from sim_action.runner.isolation import linux_child

run_job = linux_child.run_job

def listing(job, files, progress, **options):
    before = set(sys.modules)
    is_normal = run_job(job, files, progress, **options)
    more = sorted(name for name in set(sys.modules) - before if name.startswith("sim_action"))
    with Path("imported.txt").open("a") as file:
        print(job.loaded.scenario.name, *more, file=file)
    return is_normal

linux_child.run_job = listing
call(["run", "a.sim.yml", "--output-dir", "results"])
"""

VARIED = "time_limit: 1 s\nduration: 0.5 s\nvariations: {physics.rate: [240, 300]}\n"
DRIVEN = "commands: {twist: [{linear: 0.1}]}\n"
UPRIGHT = "expect: [upright: {max_tilt: 20 deg}]\n"
WORLD = """\
world:
  objects:
    - {name: cart, box: [1, 1, 1], path: [{at: 0 s, x: 5}, {at: 0.2 s, x: 4}]}
    - {name: can, box: [0.1, 0.1, 0.1], mass: 1, pose: {x: 0.3}}
expect: [{contact: {with: can, at_most: 20 N}}]
allow: [never-touched]
"""


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not fork")
@pytest.mark.parametrize(
    ("robot", "text"), [("model: slippery.urdf", DRIVEN + WORLD), ("model: rover.urdf", DRIVEN + UPRIGHT)]
)
def test_forks_import_nothing_themselves(robot: str, text: str, tmp_path: Path) -> None:
    burger = (ROOT / "sim_action/robot/built_in/turtlebot3_burger.urdf").read_text(encoding="utf-8")
    slippery = '<gazebo reference="wheel_left_link"><mu1>0.1</mu1></gazebo></robot>'
    (tmp_path / "slippery.urdf").write_text(burger.replace("</robot>", slippery), encoding="utf-8")
    rover = (ROOT / "examples/drives/rover.urdf").read_text(encoding="utf-8")
    (tmp_path / "rover.urdf").write_text(rover, encoding="utf-8")
    (tmp_path / "a.sim.yml").write_text(f"name: it\nrobot: {{{robot}}}\n{text}{VARIED}", encoding="utf-8")
    ran = interpreter(tmp_path, "-c", PROGRAM, env=outside_of_github({}))
    told = ran.stdout + ran.stderr
    assert " passed" in told, told
    listed = (tmp_path / "imported.txt").read_text(encoding="utf-8").splitlines()
    assert sorted(listed) == ["it[rate=240]", "it[rate=300]"], told
