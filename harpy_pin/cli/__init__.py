"""The ``harpy`` command."""
