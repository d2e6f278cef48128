"""The search for the planar gait: its cost, its optimisation, and whether it is periodic and
stable.
"""
