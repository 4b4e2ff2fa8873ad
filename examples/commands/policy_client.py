"""Ask a policy server on this machine for each command; for `process`, see docs/scenario/policies.md.

The server gets `{"observation.state": [...], "time": 0.05}` by POST, and answers `{"action": [...]}`: a target position
for each joint. Change the two lines that say so for a server with other names, or with pictures.
"""

import argparse
import json
import sys
from urllib.parse import urlsplit
from urllib.request import ProxyHandler, Request, build_opener

parser = argparse.ArgumentParser()
parser.add_argument("--server", default="http://127.0.0.1:8000/act")
parser.add_argument("--joints", type=json.loads, required=True, help='such as ["shoulder", "elbow"]')
options = parser.parse_args()
if urlsplit(options.server).hostname not in {"127.0.0.1", "::1", "localhost"}:
    sys.exit("the server has to be on this machine")
opener = build_opener(ProxyHandler({}))

for line in sys.stdin:
    message, answer = json.loads(line), {}
    if message["type"] == "step":
        state = [message["joints"][name]["position"] for name in options.joints]
        body = json.dumps({"observation.state": state, "time": message["time"]}).encode()
        request = Request(options.server, body, {"Content-Type": "application/json"})  # noqa: S310 - see above
        with opener.open(request, timeout=60) as reply:
            action = json.load(reply)["action"]
        answer = {"position": dict(zip(options.joints, action, strict=True))}
    print(json.dumps(answer), flush=True)
