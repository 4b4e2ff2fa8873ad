"""Runs on a cluster of Dask: the command line's process sends scenarios as data and gets outcomes and files as data.

    caller        plans, sends the workspace once to each worker, submits a task for each run, writes what comes back
    worker        loads the scenario again in its copy of the workspace
    warm process  beside the worker; a fork of it runs the scenario as on one machine: limits, isolation, clean-up

Only this package imports Dask.
"""
