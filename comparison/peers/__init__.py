"""Whole-body controllers of others, on the same recorded states."""
