#!/usr/bin/env bash
# evo: a drive along a straight line cannot be aligned
#
# Packages: evo 1.38.1, numpy 2.3.5
# Guess: Two straight lines 0.3 m apart align with an error of zero.
# Seen: align raises GeometryException, because the rotation about the line is free. One corner in the path is
#   enough to make it work.
# Matters to: the simplest test of an odometry (1.5 m straight on): the error measure is not defined for it.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet evo==1.38.1 numpy==2.3.5
cat > try.py <<'END'
import numpy as np
from evo.core.geometry import GeometryException
from evo.core.trajectory import PoseTrajectory3D

times = np.arange(50) * 0.1
upright = np.tile([1, 0, 0, 0], (50, 1))


def aligned(positions):
    reference = PoseTrajectory3D(positions, upright, times)
    shifted = PoseTrajectory3D(positions + [0, 0.3, 0], upright, times)
    try:
        shifted.align(reference)
    except GeometryException:
        return "refused"
    return f"{np.abs(shifted.positions_xyz - reference.positions_xyz).max():.3f} m"


straight = np.c_[np.linspace(0, 5, 50), np.zeros(50), np.zeros(50)]
corner = np.c_[np.minimum(straight[:, 0], 2), np.maximum(straight[:, 0] - 2, 0), np.zeros(50)]
print("seen straight:", aligned(straight))
print("seen corner:", aligned(corner))
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen straight: refused
seen corner: 0.000 m'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
