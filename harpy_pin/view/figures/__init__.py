"""Figures of a run's signals."""
