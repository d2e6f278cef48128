"""A walker that others published beside the condensed WBC; ``python -m comparison peers --install`` installs it.

A policy walks Go1: the network of MuJoCo Playground that was trained by reinforcement learning, in its own model of the
robot and its own contact. Its weights and its model come with the wheel ``playground``.
"""
