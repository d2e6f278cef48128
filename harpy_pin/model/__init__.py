"""The robot: its states, kinematics, dynamics and contact forces as maps of what it is commanded.

Conventions (frames, units, order, signs) of the whole library: :class:`harpy_pin.model.state.State`.
"""
