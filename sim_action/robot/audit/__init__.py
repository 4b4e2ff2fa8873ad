"""The audit of robot models: rules that a model must satisfy before an engine sees it.

`robot/model/findings.py` is the table of all rules, with their names and levels. `stages.py` runs the checks in order.
The other modules hold the checks, by subject.
"""
