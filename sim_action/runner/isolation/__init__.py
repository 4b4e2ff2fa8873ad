"""The child process of one scenario: its start, its progress and its end.

There are two implementations. `linux_child` isolates better and is used on Linux. `portable_child` needs only the
standard library; its docstring lists its limits.
"""
