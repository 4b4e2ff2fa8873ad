#!/usr/bin/env bash
# yourdfpy: a URDF that is written back has no mimic and no safety controller
#
# Packages: yourdfpy 0.0.60, numpy 2.3.5, scipy 1.17.1
# Guess: What yourdfpy reads and uses, it also writes: the second finger of a gripper still mimics the first.
# Seen: In memory the second joint follows the first. The written file has neither <mimic> nor <safety_controller>,
#   and two free joints.
# Matters to: programs that edit a URDF with it: grippers open with one finger only, and there is no warning.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet yourdfpy==0.0.60 numpy==2.3.5 scipy==1.17.1
cat > try.py <<'END'
from yourdfpy import URDF

GRIPPER = """<robot name="gripper"><link name="a"/><link name="b"/><link name="c"/>
<joint name="first" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/>
  <safety_controller k_velocity="5" soft_lower_limit="-0.9" soft_upper_limit="0.9"/></joint>
<joint name="second" type="revolute"><parent link="b"/><child link="c"/><axis xyz="0 0 1"/>
  <limit lower="-2" upper="2" effort="1" velocity="1"/><mimic joint="first" multiplier="2"/></joint></robot>"""
with open("gripper.urdf", "w") as file:
    file.write(GRIPPER)
robot = URDF.load("gripper.urdf")
robot.write_xml_file("again.urdf")
with open("again.urdf") as file:
    text = file.read()
print("seen free joints before:", *robot.actuated_joint_names)
print("seen free joints after:", *URDF.load("again.urdf").actuated_joint_names)
print("seen safety controller after:", "safety_controller" in text)
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen free joints before: first
seen free joints after: first second
seen safety controller after: False'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
