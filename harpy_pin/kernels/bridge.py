"""The library that calls from Python go through (bridge.c), and its memory layouts."""

from __future__ import annotations

import ctypes
import platform
import struct
import sysconfig
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from harpy_pin.errors import HarpyError, KernelError
from harpy_pin.kernels import library_files
from harpy_pin.kernels.record_view import RecordView
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


class Caller:
    """Base of what C calls, by the address that it keeps; until then :meth:`__call__` is Python's
    (:func:`join`).
    """

    __slots__ = ("_address",)
    _address: int
    slowly: Callable[..., Any]

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Run it."""
        return self.slowly(*arguments, **named)


@cache
def join(kind: type[Caller], *, chains: bool) -> None:
    """Let C make the calls of all objects of a class, which is derived from :class:`Caller`
    first; done once.
    """
    name = f"{kind.__module__}.{kind.__name__}"
    kind.__bases__ = (bridge().make_type(Caller, name.encode(), chains), *kind.__bases__[1:])


def calling_library(*files: Path) -> ctypes.PyDLL:
    """Files of C behind calls.h, as one library with the name of the last."""
    text = "\n".join(
        file.read_text(encoding="utf-8") for file in (Path(__file__).with_name("calls.h"), *files)
    )
    return library_files.library(files[-1].stem, library_files.key_of(text), lambda: text)


@cache
def bridge() -> ctypes.PyDLL:
    """The library, compiled where it is not there yet.

    Raises:
        HarpyError: there is no compiler, and the wheel does not have it; or objects of this Python
            lie in memory otherwise than bridge.c declares them, such as those of one without a
            global lock.
    """
    free, python, number = (
        sysconfig.get_config_var("Py_GIL_DISABLED"),
        ctypes.py_object,
        ctypes.c_void_p,
    )
    if not free:
        lib = calling_library(Path(__file__).with_suffix(".c"))
        caller, x = Caller(), np.zeros((2, 3))
        caller._address = id(caller)
        known = (id(np.ndarray), x.ctypes.data, id(x.dtype), id(RecordView))
        lib.lies_as_declared.restype = ctypes.c_bool
        if lib.lies_as_declared(*map(python, (caller, caller._address, x)), *map(number, known)):
            lib.make_type.restype = lib.try_call.restype = python
            lib.make_type.argtypes = [python, ctypes.c_char_p, ctypes.c_bool]
            lib.try_call.argtypes = [python, python]
            lib.bind_call.restype = ctypes.c_bool
            lib.bind_call.argtypes = [python, python, ctypes.POINTER(Bound)]
            return lib
    kind = " without its global lock" if free else ""
    found = f"Python {platform.python_version()}{kind} with NumPy {np.__version__}"
    raise HarpyError(
        f"kernels cannot be called from {found}: take CPython from 3.11 on as it is usually built"
    )


class Bound(ctypes.Structure):
    """A kernel with its arguments, for compiled code that calls it; it keeps their memory."""

    _fields_ = (("entry", ctypes.c_void_p), ("slots", ctypes.c_int64 * MAX_SLOTS))
    arguments: tuple[Any, ...]  # as they were given


class Version:
    """A kernel compiled for one set of types: a ``version`` of bridge.c, with all that its memory
    points to.

    ``entry`` is the address of the function to call. The library has told the letters of its
    results, and the arguments whose memory it writes. With ``release`` other threads of Python may
    go on meanwhile.
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
            most = (
                f"{MAX_SLOTS} numbers, arrays and sizes, {MAX_SYMBOLS} sizes with names, "
                f"{MAX_RESULTS} results"
            )
            raise KernelError(f"calls from Python have at most {most}")
        head = struct.pack("PPPii", entry, 0, ctypes.addressof(letters), len(types), release)
        self.memory = ctypes.create_string_buffer(head + b"".join(parts))

    def before(self, address: int) -> int:
        """Its own address, after which C goes on with the version at another one."""
        struct.pack_into("P", self.memory, struct.calcsize("P"), address)
        return ctypes.addressof(self.memory)

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
                raise KernelError(
                    f"'{name}' has {len(shape)} axes; calls from Python pass at most {MAX_AXES}"
                )
            dtype = element.dtype if isinstance(element, Struct) else DTYPES[str(element)]
            self._kept.append(dtype)
            written = isinstance(element, Struct) or name in self._told["written"]
            follow = [not isinstance(n, int) for n in shape]
            self._slots += 1 + sum(follow)
            yield _pack(
                ARRAY, len(shape), written, id(dtype), encode(shape, stated, self._symbols), follow
            )
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
    return struct.pack(
        "iiiiP4q", kind, axes, written, known, pointer, *sizes, *[ANY] * (4 - len(sizes))
    )
