"""The audit of robot models: rules that a model must satisfy before an engine sees it.

`robot/model/findings.py` is the table of all rules, with their names and levels. The modules hold the checks, by
subject: `reading/urdf.py` runs the checks of elements in stages, and `reading/building.py` the checks of drafts.
"""
