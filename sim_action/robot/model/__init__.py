"""A robot as data: links and joints, the findings of the audit, kinematics, and the `robot` section of a scenario."""
