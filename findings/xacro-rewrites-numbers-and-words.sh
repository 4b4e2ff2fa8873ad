#!/usr/bin/env bash
# xacro: a property is read as a number or a truth value before it becomes text
#
# Packages: xacro 2.1.1, pyyaml 6.0.4
# Guess: A property is text: leg_${id} with id 007 is leg_007, and true stays true.
# Seen: The link is called leg_7, 1.10 becomes 1.1, and <static>${fixed}</static> becomes True, with a capital
#   letter.
# Matters to: names of links that controllers and SRDF files expect, and flags inside <gazebo> elements.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet xacro==2.1.1 pyyaml==6.0.4
cat > try.py <<'END'
import xacro

TEXT = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r">
  <xacro:property name="id" value="007"/><xacro:property name="version" value="1.10"/>
  <xacro:property name="fixed" value="true"/>
  <link name="leg_${id}"/><a>${version}</a><static>${fixed}</static>
</robot>"""
document = xacro.parse(TEXT)
xacro.process_doc(document)
name = document.getElementsByTagName("link")[0].getAttribute("name")
words = [document.getElementsByTagName(tag)[0].firstChild.data for tag in ("a", "static")]
print("seen", name, *words)
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen leg_7 1.1 True'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
