"""Docstrings have Sphinx' roles, such as ``:class:`~harpy_pin.Run```; the site shows them as
links.
"""

from __future__ import annotations

import re
from typing import Any

import griffe

_ROLE = re.compile(r":(?:attr|class|data|func|meth|mod):`(~?)([^`]+)`")
_BLOCK = re.compile(r"::$", re.M)


class Roles(griffe.Extension):
    """Links to what the reference holds, names in code for the rest."""

    def on_object(self, *, obj: griffe.Object, loader: Any, **kwargs: Any) -> None:
        """Rewrite the docstring of every object, once it is read."""
        if obj.docstring is not None:

            def link(match: re.Match[str]) -> str:
                short, name = match[1], match[2]
                shown = name.rpartition(".")[2] if short else name.removeprefix("harpy_pin.")
                first, *members = name.split(".")
                try:
                    path = (
                        name if first == "harpy_pin" else ".".join([obj.resolve(first), *members])
                    )
                except griffe.NameResolutionError:
                    path = f"{obj.path}.{name}"
                return f'<autoref identifier="{path}" optional>`{shown}`</autoref>'

            obj.docstring.value = _BLOCK.sub(":", _ROLE.sub(link, obj.docstring.value))
