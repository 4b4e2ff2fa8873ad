#!/usr/bin/env bash
# urchin: a joint that mimics a joint that mimics a third one stays at zero
#
# Packages: urchin 0.0.30, numpy 2.3.5, scipy 1.17.1
# Guess: With the first joint at 0.8 rad, the second (half of the first) is at 0.4 rad and the third (twice the
#   second) at 0.8.
# Seen: The second is at 0.4 rad, the third at 0: the position of a joint that mimics is not known to its followers.
#   Setting the second joint is not possible either, as it is no actuated one.
# Matters to: grippers with several phalanges: fingertips are drawn and measured at a wrong place.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet urchin==0.0.30 numpy==2.3.5 scipy==1.17.1
cat > try.py <<'END'
import math

from urchin import URDF

LINK = """<link name="%s"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="%s" type="revolute"><parent link="a"/><child link="%s"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/>%s</joint>"""
joints = (
    ("first", "b", ""),
    ("second", "c", '<mimic joint="first" multiplier="0.5"/>'),
    ("third", "d", '<mimic joint="second" multiplier="2"/>'),
)
with open("model.urdf", "w") as file:
    file.write(f'<robot name="r">{"".join(LINK % name for name in "abcd")}{"".join(JOINT % joint for joint in joints)}</robot>')
robot = URDF.load("model.urdf")
placed = robot.link_fk({"first": 0.8}, use_names=True)
for name, link, _ in joints:
    print(f"seen {name}: {math.atan2(placed[link][1, 0], placed[link][0, 0]):.1f} rad")
END
seen=$(venv/bin/python try.py 2> /dev/null | grep '^seen')
stated='seen first: 0.8 rad
seen second: 0.4 rad
seen third: 0.0 rad'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
