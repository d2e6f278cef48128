"""Whole-body controllers and QP solvers of others, on the same recorded states and programs."""
