"""A published policy walks beside the condensed WBC, in the policy's own model of the robot and its own contact.

The policy is the Go1 of MuJoCo Playground: a network that was trained by reinforcement learning. Its weights and its
model come with the wheel ``playground``; ``python -m comparison peers --install`` puts it in an environment of its own.
"""
