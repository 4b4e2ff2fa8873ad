"""What replaces rospy's function is read by every Python of a launch, and hides nothing that was there."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from sim_action.ros1 import awaited_messages


def test_a_sitecustomize_that_was_there_is_read_after_ours(tmp_path: Path) -> None:
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    ours.mkdir()
    theirs.mkdir()
    (ours / "sitecustomize.py").symlink_to(awaited_messages.__file__)
    (theirs / "sitecustomize.py").write_text("import sys\nsys.hooked = True\n")
    rospy = theirs / "rospy"
    rospy.mkdir()
    (rospy / "__init__.py").write_text("from rospy.client import wait_for_message\n")
    (rospy / "client.py").write_text("def wait_for_message(): ...\ndef get_param(): ...\n")
    modules = "rospy.wait_for_message.__module__, rospy.client.get_param.__module__"
    code = f"import rospy, rospy.client, sys; print(sys.hooked, {modules})"
    variables = {**os.environ, "PYTHONPATH": f"{ours}{os.pathsep}{theirs}"}

    said = subprocess.run([sys.executable, "-c", code], env=variables, capture_output=True, text=True, check=True)

    assert said.stdout.split() == ["True", "sitecustomize", "rospy.client"]
