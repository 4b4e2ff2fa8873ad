"""Drives at the wall, slows down on the last metre, and stops half a metre before it."""

import json
import sys

GOAL = 2.5
TOP_SPEED = 0.5

for line in sys.stdin:
    seen = json.loads(line)
    if seen["type"] == "step":
        x, _, _ = seen["pose"]["position_xyz"]
        answer = {"twist": {"linear": max(0.0, min(TOP_SPEED, GOAL - x))}}
    else:
        # The first line tells about the robot, and wants no command yet.
        print("drives", seen["robot"]["name"], file=sys.stderr)
        answer = {}
    print(json.dumps(answer), flush=True)
