#!/usr/bin/env bash
# spatialmath: a quaternion interpolates the long way round, a pose the short way
#
# Packages: spatialmath-python 1.1.18, numpy 2.3.5, scipy 1.17.1
# Guess: Half-way between the headings -3 and +3 rad is 3.14 rad, with whichever class of the library: 0.28 rad lie
#   between them.
# Seen: SE3 and SO3 give 3.14 rad. UnitQuaternion gives 0 rad and turns by 6 rad, unless shortest=True is set.
# Matters to: paths of orientations: the tool or the robot makes a whole turn between two poses that are next to each
#   other.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet spatialmath-python==1.1.18 numpy==2.3.5 scipy==1.17.1
cat > try.py <<'END'
from spatialmath import SE3, SO3, UnitQuaternion

for kind in (SE3, SO3, UnitQuaternion):
    middle = kind.Rz(-3.0).interp(kind.Rz(3.0), 3)[1]
    print(f"seen {kind.__name__}: {abs(middle.rpy()[2]):.2f}")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen SE3: 3.14
seen SO3: 3.14
seen UnitQuaternion: 0.00'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
