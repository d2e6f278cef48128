"""A window for Meshcat visualizers that keeps the commands instead of sending them to a server."""

from __future__ import annotations

import base64
from typing import Any

import umsgpack
from meshcat import Visualizer

__all__ = ["CommandRecorder", "set_exactly"]


class CommandRecorder:
    """Stands in for Meshcat's window: no server, no ports, nothing to clean up.

    Attributes:
        commands: what was sent, in order, as Meshcat's dictionaries.
    """

    def __init__(self) -> None:
        self.commands: list[dict[str, Any]] = []

    @property
    def visualizer(self) -> Any:
        """A ``meshcat.Visualizer`` that draws into this recorder."""
        return Visualizer(window=self)

    def send(self, command: Any) -> None:
        """Keep one command (the method that Meshcat calls)."""
        self.commands.append(command.lower())

    def encoded(self) -> list[str]:
        """The commands as base64 text of MessagePack, the form the viewer reads."""
        return [base64.b64encode(umsgpack.packb(command)).decode("ascii") for command in self.commands]


class _ExactProperty:
    """A property with its name as it is: Meshcat's own command turns ``castShadow`` into ``castshadow``."""

    def __init__(self, path: str, name: str, value: Any) -> None:
        self._command = {"type": "set_property", "path": path, "property": name, "value": value}

    def lower(self) -> dict[str, Any]:
        return self._command


def set_exactly(node: Any, name: str, value: Any) -> None:
    """Set a property of a node of the scene whose name has capitals.

    Args:
        node: a Meshcat visualizer at the node's path.
        name: of the property, as three.js spells it.
        value: of the property.
    """
    node.window.send(_ExactProperty(node.path.lower(), name, value))
