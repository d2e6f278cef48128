"""The explicit reference governor next to a QP whole-body controller: same robot, same states, same
clock.

Run it from a checkout: ``python -m comparison --help``.
"""
