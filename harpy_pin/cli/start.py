"""Entry point of the ``harpy`` command: it imports next to nothing, so that a signal meets no half-imported module."""

from __future__ import annotations

from harpy_pin.cli.signals import leave_at_signals

__all__ = ["main"]


def main() -> None:
    """Run the command."""
    leave_at_signals()
    from harpy_pin.cli.app import main as run

    run()
