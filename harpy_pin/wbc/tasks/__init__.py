"""Tasks of a whole-body problem, one kind in each file: those that every problem has, and those
that users add.
"""
