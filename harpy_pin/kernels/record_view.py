"""Records as others get them: what kernels take for indices and counts cannot be written from
outside.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.errors import InputError

_Array = NDArray[Any]


class RecordView(np.ndarray[Any, np.dtype[np.void]]):
    """A record whose fields that are whole numbers are read only; kernels take it like the record
    itself.
    """

    def __getitem__(self, key: Any) -> Any:
        part = super().__getitem__(key)
        if not isinstance(part, np.ndarray):
            return read_only(self.view(np.ndarray))[key]
        if part.dtype.names:
            return part
        return read_only(part.view(np.ndarray)) if part.dtype.kind == "i" else part.view(np.ndarray)

    def __setitem__(self, key: Any, value: Any) -> None:
        if not _is_free(self.dtype[key] if isinstance(key, str) else self.dtype):
            what = repr(key) if isinstance(key, str) else "a record with whole numbers"
            raise InputError(f"{what} is read only", name="key", value=key)
        super().__setitem__(key, value)


@cache
def _is_free(kind: np.dtype[Any]) -> bool:
    """Whether what has this type can be written: it has no whole numbers."""
    if kind.names:
        return all(_is_free(kind[name]) for name in kind.names)
    return kind.base.kind == "f"


def read_only(array: _Array) -> _Array:
    """The memory of an array, which cannot be written through this array."""
    view = array.view()
    view.flags.writeable = False
    return view
