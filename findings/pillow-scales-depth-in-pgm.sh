#!/usr/bin/env bash
# Pillow: values of a PGM are scaled when its maximum is not 255 or 65535
#
# Packages: pillow 13.0.0, numpy 2.3.5
# Guess: A depth image in millimetres with "10000" in its header keeps its values: 2500 stays 2500.
# Seen: 2500 of 10000 becomes 16384 of 65535, and 50 of 100 becomes 128 of 255.
# Matters to: depth images and occupancy maps in PGM: distances are wrong by a constant factor, without a warning.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet pillow==13.0.0 numpy==2.3.5
cat > try.py <<'END'
import io

import numpy as np
from PIL import Image


def read(maximum, value, kind):
    data = f"P5\n1 1\n{maximum}\n".encode() + np.array([value], kind).tobytes()
    return int(np.asarray(Image.open(io.BytesIO(data)))[0, 0])


print("seen 2500 of 10000:", read(10000, 2500, ">u2"))
print("seen 50 of 100:", read(100, 50, "u1"))
print("seen 2500 of 65535:", read(65535, 2500, ">u2"))
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen 2500 of 10000: 16384
seen 50 of 100: 128
seen 2500 of 65535: 2500'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
