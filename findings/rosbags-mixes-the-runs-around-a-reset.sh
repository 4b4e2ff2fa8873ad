#!/usr/bin/env bash
# rosbags, mcap: a log with a reset of the clock is read as two runs that alternate
#
# Packages: rosbags 0.11.9, mcap 1.6.0, numpy 2.3.5
# Guess: A reader of a log gives the messages as they were recorded, or fails where the time falls.
# Seen: Both sort by time. Speeds 1, 1, 1, recorded before a simulation was reset, and 0, 0, 0 after it come as 1 0 1 0
#   1 0. mcap keeps the order of the file only if asked by log_time_order=False.
# Matters to: logs recorded in sim time (ros2 bag record --use-sim-time) while the simulator is reset, or while a clock
#   is set back: a replay drives and stops in turn, and no number of it is right.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet rosbags==0.11.9 mcap==1.6.0 numpy==2.3.5
cat > try.py <<'END'
from pathlib import Path

from mcap.reader import make_reader
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_HUMBLE)
kind = "std_msgs/msg/Float64"
recorded = [(0, 1.0), (100, 1.0), (200, 1.0), (50, 0.0), (150, 0.0), (250, 0.0)]
for name, plugin in (("sqlite", StoragePlugin.SQLITE3), ("mcap", StoragePlugin.MCAP)):
    with Writer(Path(name), version=9, storage_plugin=plugin) as writer:
        topic = writer.add_connection("/speed", kind, typestore=store)
        for time, speed in recorded:
            writer.write(topic, time, store.serialize_cdr(store.types[kind](speed), kind))
    with Reader(Path(name)) as reader:
        speeds = [store.deserialize_cdr(data, kind).data for _, _, data in reader.messages()]
    print("seen rosbags", name, *(f"{speed:g}" for speed in speeds))
for in_order in (True, False):
    with Path("mcap/mcap.mcap").open("rb") as file:
        messages = [m.data for *_, m in make_reader(file).iter_messages(log_time_order=in_order)]
    print("seen mcap", *(f"{store.deserialize_cdr(data, kind).data:g}" for data in messages))
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen rosbags sqlite 1 0 1 0 1 0
seen rosbags mcap 1 0 1 0 1 0
seen mcap 1 0 1 0 1 0
seen mcap 1 1 1 0 0 0'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
