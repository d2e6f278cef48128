"""The library that calls from Python go through (bridge.c), and its memory layouts."""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from harpy_pin.errors import KernelError
from harpy_pin.kernels import compiler
from harpy_pin.kernels.shapes import ANY, Shape, encode
from harpy_pin.kernels.types import Array, Struct, Tuple, Type

ARRAY, NUMBER, WHOLE, TRUTH, TUPLE = range(5)  # kinds of arguments
MAX_AXES, MAX_SLOTS, MAX_RESULTS, MAX_SYMBOLS = 4, 128, 16, 8  # limits, as in bridge.c
SCALARS = {"real": NUMBER, "integer": WHOLE, "bool": TRUTH}
DTYPES = {
    "real": np.dtype(np.float64),
    "float": np.dtype(np.float32),
    "integer": np.dtype(np.int64),
    "bool": np.dtype(np.bool_),
}


@cache
def bridge() -> ctypes.PyDLL:
    """The library, compiled where it is not there yet."""
    text = Path(__file__).with_name("bridge.c").read_text(encoding="utf-8")
    lib = compiler.library("bridge", compiler.key_of(text), lambda: text)
    lib.make_type.restype = ctypes.py_object
    lib.make_type.argtypes = [ctypes.py_object, ctypes.py_object]
    lib.add_version.argtypes = [ctypes.py_object, ctypes.c_void_p]
    lib.try_call.restype = ctypes.py_object
    lib.try_call.argtypes = [ctypes.py_object, ctypes.py_object]
    lib.make_chain_type.restype = ctypes.py_object
    lib.set_chain.argtypes = [ctypes.py_object, ctypes.c_void_p]
    lib.bind_call.restype = ctypes.c_bool
    lib.bind_call.argtypes = [ctypes.py_object, ctypes.py_object, ctypes.POINTER(Bound)]
    return lib


class Bound(ctypes.Structure):
    """A kernel with its arguments, for compiled code that calls it; it keeps their memory."""

    _fields_ = (("entry", ctypes.c_void_p), ("slots", ctypes.c_int64 * MAX_SLOTS))
    arguments: tuple[Any, ...]  # as they were given


class Version:
    """A kernel compiled for one set of types: a ``version`` of bridge.c, with all that its memory points to.

    ``entry`` is the address of the function to call. The library has told the letters of its results, and the arguments
    whose memory it writes. With ``release`` other threads of Python may go on meanwhile.
    """

    def __init__(
        self,
        entry: int | None,
        told: Mapping[str, Any],
        types: Mapping[str, Type],
        shapes: Mapping[str, Shape],
        *,
        release: bool,
    ) -> None:
        self._told, self._shapes = told, shapes
        self._symbols: dict[str, int] = {}
        letters = ctypes.create_string_buffer(told["results"].encode())
        self._kept: list[object] = [letters]
        self._slots = 0
        parts = [part for name, kind in types.items() for part in self._argument(name, kind)]
        results = len(told["results"].lstrip("("))
        if self._slots > MAX_SLOTS or results > MAX_RESULTS or len(self._symbols) > MAX_SYMBOLS:
            most = f"{MAX_SLOTS} numbers, arrays and sizes, {MAX_SYMBOLS} sizes with names, {MAX_RESULTS} results"
            raise KernelError(f"calls from Python have at most {most}")
        head = struct.pack("PPPii", entry, 0, ctypes.addressof(letters), len(types), release)
        self.memory = ctypes.create_string_buffer(head + b"".join(parts))

    def _argument(self, name: str, kind: Type) -> Iterator[bytes]:
        """The memory of an ``argument``, and of those inside a tuple."""
        stated = self._shapes.get(name)
        if isinstance(kind, Tuple):
            yield _pack(TUPLE, len(kind.items))
            for n, item in enumerate(kind.items):
                yield from self._argument(f"{name}_{n}", item)
        elif isinstance(kind, Array | Struct):
            element = kind.element if isinstance(kind, Array) else kind
            shape = kind.shape if isinstance(kind, Array) else ()
            if len(shape) > MAX_AXES:
                raise KernelError(f"'{name}' has {len(shape)} axes; calls from Python pass at most {MAX_AXES}")
            dtype = element.dtype if isinstance(element, Struct) else DTYPES[str(element)]
            self._kept.append(dtype)
            written = isinstance(element, Struct) or name in self._told["written"]
            follow = [isinstance(n, str) for n in shape]
            self._slots += 1 + sum(follow)
            yield _pack(ARRAY, len(shape), written, id(dtype), encode(shape, stated, self._symbols), follow)
        else:
            self._slots += 1
            most = encode((), (stated,), self._symbols) if isinstance(stated, str) else ()
            yield _pack(SCALARS[str(kind)], sizes=most)


def _pack(
    kind: int,
    axes: int = 0,
    written: bool = False,
    pointer: int = 0,
    sizes: Sequence[int] = (),
    follow: Sequence[bool] = (),
) -> bytes:
    """The memory of one ``argument``."""
    known = sum(1 << n for n, run_time in enumerate(follow) if run_time)
    return struct.pack("iiiiP4q", kind, axes, written, known, pointer, *sizes, *[ANY] * (4 - len(sizes)))
