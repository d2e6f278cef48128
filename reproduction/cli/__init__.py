"""The commands of the reproduction: ``python -m reproduction``."""
