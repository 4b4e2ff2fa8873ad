"""ROS 2 messages of a run, encoded without ROS: message definitions, CDR encoding, and the topics of a log."""
