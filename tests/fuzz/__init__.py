"""A fuzzer that knows the structure of its inputs: scenarios, models, and the files that scenarios name.

    python -m tests.fuzz --minutes 15 --seed 1 --keep /tmp/found

`cases` makes an input from a seed, `damage` and `urdf_damage` change it, `trial` and `urdf_trial` examine it in a child
process, `corpus` keeps inputs that once found a fault.
"""
