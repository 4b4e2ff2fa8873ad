#!/usr/bin/env bash
# mcap-ros2-support: a misspelled field of a message is lost, and 1.9 in an integer becomes 1
#
# Packages: mcap-ros2-support 0.6.0, mcap 1.6.0
# Guess: write_message of a dictionary with a misspelled field raises, as the constructor of a ROS message does.
# Seen: It writes the message: the right field is 0, the misspelled one is lost, and 1.9 in an int32 is 1.
# Matters to: recordings that a script makes for a test: a velocity is 0 throughout, and the test that reads it
#   passes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet mcap-ros2-support==0.6.0 mcap==1.6.0
cat > try.py <<'END'
import io

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer

file = io.BytesIO()
writer = Writer(file)
schema = writer.register_msgdef("pkg/msg/Wheel", "float64 speed\nint32 ticks\n")
writer.write_message("/wheel", schema, {"sped": 2.5, "ticks": 1.9}, 1, 1)
writer.finish()
file.seek(0)
for decoded in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
    print("seen speed", decoded.decoded_message.speed, "ticks", decoded.decoded_message.ticks)
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen speed 0.0 ticks 1'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
