#!/usr/bin/env bash
# rosbags: points that plyfile read from a big-endian PLY become noise in a message
#
# Packages: rosbags 0.11.9, plyfile 1.1.5, numpy 2.3.5
# Guess: An array of floats that equals [1, 2] in NumPy is 1 and 2 after a message was written and read.
# Seen: plyfile keeps the byte order of the file in the type of the array. rosbags writes its bytes as they are: 1.0
#   is read back as 4.6e-41. An array of doubles is refused.
# Matters to: scans and meshes that a script puts into a bag: nothing fails, and all points lie at the origin.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet rosbags==0.11.9 plyfile==1.1.5 numpy==2.3.5
cat > try.py <<'END'
import numpy as np
from plyfile import PlyData, PlyElement
from rosbags.typesys import Stores, get_typestore

points = np.array([(1,), (2,)], dtype=[("x", "f4")])
PlyData([PlyElement.describe(points, "vertex")], byte_order=">").write("scan.ply")
ranges = PlyData.read("scan.ply")["vertex"]["x"]
store = get_typestore(Stores.ROS2_HUMBLE)
channel = store.types["sensor_msgs/msg/ChannelFloat32"]
for name, values in (("file", np.array(ranges)), ("native", np.array(ranges, np.float32))):
    written = store.serialize_cdr(channel(name="x", values=values), channel.__msgtype__)
    read = store.deserialize_cdr(written, channel.__msgtype__).values
    print(f"seen {name}: {values[0]:.1f} {values[1]:.1f} -> {read[0]:.1e} {read[1]:.1e}")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen file: 1.0 2.0 -> 4.6e-41 9.0e-44
seen native: 1.0 2.0 -> 1.0e+00 2.0e+00'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
