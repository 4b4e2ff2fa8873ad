#!/usr/bin/env bash
# Pinocchio: computeTotalMass leaves out the base link of a robot that is bolted down
#
# Packages: pin 4.1.0
# Guess: The mass of a URDF is the sum of its links, 5 + 2 kg, whatever the root joint is.
# Seen: It is 2 kg for a fixed base and 7 kg with a free-flyer: the base link belongs to the universe. centerOfMass
#   follows the same rule.
# Matters to: audits of models and gravity checks: the figure depends on how the model was loaded.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet pin==4.1.0
cat > try.py <<'END'
import pinocchio

ARM = """<robot name="arm">
  <link name="base"><inertial><mass value="5"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="bar"><inertial><origin xyz="0.5 0 0"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.2"/></inertial>
    <collision><origin xyz="0.5 0 0"/><geometry><box size="1 0.1 0.1"/></geometry></collision></link>
  <joint name="hinge" type="%s"><parent link="base"/><child link="bar"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="100" velocity="10"/></joint>
</robot>"""

fixed = pinocchio.buildModelFromXML(ARM % "revolute")
free = pinocchio.buildModelFromXML(ARM % "revolute", pinocchio.JointModelFreeFlyer())
print(f"seen fixed {pinocchio.computeTotalMass(fixed):g} kg, free {pinocchio.computeTotalMass(free):g} kg")
centre = pinocchio.centerOfMass(fixed, fixed.createData(), pinocchio.neutral(fixed))
print(f"seen centre of mass of the fixed one at {centre[0]:.3f} m")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen fixed 2 kg, free 7 kg
seen centre of mass of the fixed one at 0.500 m'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
