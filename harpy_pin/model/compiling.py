"""Says when kernels are compiled: the first time a robot of its size is used, which takes seconds to minutes.

Numba keeps the result on disk, so this happens once. The notice is a warning of the logger ``harpy_pin.compiling``,
given once in a process; ``logging.getLogger("harpy_pin.compiling").setLevel("ERROR")`` silences it.
"""

from __future__ import annotations

import logging
from typing import Any

import numba
from numba.core import event

__all__ = ["CompilingNotice", "seal"]

_LOGGER = logging.getLogger("harpy_pin.compiling")


class CompilingNotice(event.Listener):
    """Gives the notice when Numba begins to compile the first of this library's kernels."""

    given = False

    def on_start(self, event: event.Event) -> None:
        """Called by Numba before it compiles; kernels that come from its disk cache do not pass here."""
        kernel = event.data["dispatcher"].py_func
        if not self.given and kernel.__module__.startswith("harpy_pin"):
            self.given = True
            _LOGGER.warning(
                "compiling kernels for a robot of this size, for up to some minutes; the result is kept on disk"
            )

    def on_end(self, event: event.Event) -> None:
        """Nothing to say."""


event.register("numba:compile", CompilingNotice())  # type: ignore[no-untyped-call]


def seal(kernel: Any, *arguments: Any) -> None:
    """Compile a kernel for arguments like these; it refuses other kinds with a ``TypeError`` from now on.

    Otherwise an array of integers, or one that is not contiguous, would make it compile anew, for seconds.

    Args:
        kernel: one that a user's arrays reach, compiled by Numba.
        arguments: of the types that it is to take; it is not called.
    """
    kernel.disable_compile(False)
    kernel.compile(tuple(numba.typeof(argument) for argument in arguments))  # type: ignore[no-untyped-call]
    kernel.disable_compile()
