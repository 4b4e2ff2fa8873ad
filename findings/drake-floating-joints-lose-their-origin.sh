#!/usr/bin/env bash
# Drake: the child of a floating joint of a URDF starts at its parent, not at the origin of the joint
#
# Packages: drake 1.51.1, numpy 2.3.5
# Guess: A floating joint starts with its child at <origin>, 2 m above its parent, as a fixed and a revolute joint
#   have it.
# Seen: Fixed and revolute: 2 m above. Floating: 0 m, inside of its parent. No warning is given.
# Matters to: scenes in one URDF: a load above a gripper, or a rider on a base, starts inside of it and is thrown out.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet drake==1.51.1 numpy==2.3.5
cat > try.py <<'END'
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

LINK = """<link name="%s"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="j" type="%s"><parent link="a"/><child link="b"/><origin xyz="0 0 2"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"""
for kind in ("fixed", "revolute", "floating"):
    plant = MultibodyPlant(0.001)
    text = f'<robot name="r">{LINK % "a"}{LINK % "b"}{JOINT % kind}</robot>'
    Parser(plant).AddModelsFromString(text, "urdf")
    plant.Finalize()
    context = plant.CreateDefaultContext()
    places = [plant.EvalBodyPoseInWorld(context, plant.GetBodyByName(name)).translation() for name in "ab"]
    print(f"seen {kind}: {places[1][2] - places[0][2]:.1f} m above")
END
seen=$(venv/bin/python try.py 2> /dev/null | grep '^seen')
stated='seen fixed: 2.0 m above
seen revolute: 2.0 m above
seen floating: 0.0 m above'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
