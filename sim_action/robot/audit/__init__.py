"""The audit of robot models: rules that a model must satisfy before an engine sees it.

`robot/model/findings.py` is the table of all rules, with their names and levels. `reading/urdf.py` runs the checks
in stages. The modules hold the checks, by subject.
"""
