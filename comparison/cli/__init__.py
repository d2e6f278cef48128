"""The command line: ``python -m comparison``, one file for each group of commands."""

from comparison.cli.program import app, main

__all__ = ["app", "main"]
