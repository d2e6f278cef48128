"""A joint PD controller with feedforward, and the search for its gains: what a walk gets without an
optimum.
"""
