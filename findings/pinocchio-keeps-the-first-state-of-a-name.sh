#!/usr/bin/env bash
# Pinocchio: of the group states of one name in an SRDF, the first group alone moves
#
# Packages: pin 4.1.0
# Guess: An SRDF with the state 'home' for a left and for a right arm gives a configuration 'home' with both, or an
#   error.
# Seen: It has the left arm at 0.5 rad and the right arm at 0, not at 0.7. A second file with 'home' changes nothing
#   either. There is no warning.
# Matters to: robots with two arms or a gripper, whose MoveIt files use a name such as 'home' for each group.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet pin==4.1.0
cat > try.py <<'END'
import pinocchio

LINK = """<link name="%s"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="{0}_joint" type="revolute"><parent link="base"/><child link="{0}"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"""
STATE = "<group_state name='home' group='{0}'><joint name='{0}_joint' value='{1}'/></group_state>"


def robot(parts):
    return f"<robot name='r'>{''.join(parts)}</robot>"


links = [LINK % name for name in ("base", "left", "right")]
model = pinocchio.buildModelFromXML(robot([*links, JOINT.format("left"), JOINT.format("right")]))
pinocchio.loadReferenceConfigurationsFromXML(model, robot([STATE.format("left", 0.5), STATE.format("right", 0.7)]))
print("seen both in one file:", *model.referenceConfigurations["home"])
pinocchio.loadReferenceConfigurationsFromXML(model, robot([STATE.format("left", 0.9)]))
print("seen after a second file:", *model.referenceConfigurations["home"])
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen both in one file: 0.5 0.0
seen after a second file: 0.5 0.0'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
