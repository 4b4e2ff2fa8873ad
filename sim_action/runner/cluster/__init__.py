"""Runs on a cluster of Dask: the command line's process sends scenarios as data and gets outcomes and files as data.

    caller        plans, sends the workspace once to each worker, submits tasks of one or more runs, writes the results
    worker        loads the scenarios again in its copy of the workspace
    warm process  started by the worker; a fork of it runs the scenarios as on one machine: limits, isolation, clean-up

Only this package imports Dask.
"""
