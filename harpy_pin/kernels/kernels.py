"""``@kernel``: a function of numbers and arrays that runs as C.

The first call with arguments of new types translates and compiles it; the library is kept, so that
the next process only loads it.
"""

from __future__ import annotations

import ctypes
import json
import os
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache, update_wrapper
from inspect import signature
from pathlib import Path
from threading import RLock
from types import FunctionType
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload
from weakref import WeakSet

import numpy as np

from harpy_pin.errors import KernelError
from harpy_pin.kernels import compiler, library_files
from harpy_pin.kernels.argument_types import argument_types
from harpy_pin.kernels.bridge import DTYPES, Bound, Caller, Version, bridge, join
from harpy_pin.kernels.shapes import Shape, check_shapes
from harpy_pin.kernels.source import fingerprint, remember
from harpy_pin.kernels.types import Array, Struct, Type

_LOCK = RLock()
_TRANSLATING = RLock()  # Python's parser is for one thread at a time
_KERNELS: WeakSet[Kernel[Any]] = WeakSet()


Result = TypeVar("Result")
Result_co = TypeVar("Result_co", covariant=True)


class Kernel(Caller, Generic[Result_co]):
    """A function in the language of kernels, see docs/kernels.md; ``Kernel[float]`` returns a
    number.

    Attributes:
        py_func: the function in Python.
    """

    def __init__(
        self, function: FunctionType, shapes: Mapping[str, Shape], *, release: bool = False
    ) -> None:
        update_wrapper(self, function)
        self.py_func = function
        self._signature = signature(function)
        remember(function)
        self._shapes = shapes
        self._release = release
        self._names = list(self._signature.parameters)
        self._versions: dict[tuple[Type, ...], Future[None]] = {}
        self._kept: list[object] = []
        _KERNELS.add(self)
        unknown = shapes.keys() - set(self._names)
        assert not unknown, f"{function.__name__} has no arguments {unknown}"

    if TYPE_CHECKING:

        def __call__(self, *arguments: Any, **named: Any) -> Result_co:
            """Run it."""

    def slowly(self, *arguments: Any, **named: Any) -> Any:
        """A call with arguments of new types: they are checked, and the kernel is compiled for
        them.

        An :class:`InputError` is of an array of another shape than the kernel states, a
        :class:`KernelError` of other kinds.
        """
        given = self._bind(arguments, named)
        check_shapes(self.py_func.__name__, self._shapes, given)
        values = tuple(_plain(value) for value in given.values())
        self._finish(self._begin(values))
        result = bridge().try_call(self, values)
        if result == () and any(map(_has_gaps, values)):
            packed = tuple(
                np.ascontiguousarray(value) if _has_gaps(value) else value for value in values
            )
            result = bridge().try_call(self, packed)
            for value, copy in zip(values, packed, strict=True):
                if value is not copy and value.flags.writeable:
                    value[...] = copy
        if result == ():
            raise KernelError(
                f"{self.py_func.__name__} does not take arguments like these: {_described(given)}"
            )
        return result

    def prepare(self, *arguments: Any) -> Future[None]:
        """Begin to compile for arguments like these, in the background; the kernel is not called.

        The future is done once it can be called. A :class:`KernelError` says that the kernel does
        not take such arguments.
        """
        return self._versions[self._begin(tuple(map(_plain, self._bind(arguments, {}).values())))]

    def bind(self, *arguments: Any) -> Bound:
        """The kernel with arguments that stay where they are, for C that calls it; it is compiled
        if need be.

        Errors are those of :meth:`slowly`.
        """
        given = self._bind(arguments, {})
        check_shapes(self.py_func.__name__, self._shapes, given)
        bound = Bound()
        bound.arguments = tuple(map(_plain, given.values()))
        self._finish(self._begin(bound.arguments))
        moved = any(isinstance(value, np.void) for value in given.values())
        if moved or not bridge().bind_call(self, bound.arguments, ctypes.byref(bound)):
            raise KernelError(
                f"{self.py_func.__name__} cannot be bound to arguments like these: "
                f"{_described(given)}"
            )
        return bound

    def _begin(self, values: tuple[Any, ...]) -> tuple[Type, ...]:
        """See to it that a library for such arguments is made, or will be; returns their types."""
        types = argument_types(self, dict(zip(self._names, values, strict=True)))
        with _LOCK:
            if types not in self._versions:
                self._refuse_other_axes(types)
                self._versions[types] = _workers().submit(self._load, types)
        return types

    def _finish(self, types: tuple[Type, ...]) -> None:
        """Wait for a library; one whose turn has not come yet, or that could not be made, is made
        in this thread.
        """
        with _LOCK:
            future = self._versions[types]
            ours = future.cancel() or (future.done() and future.exception() is not None)
            if ours:
                future = self._versions[types] = Future()
                future.set_running_or_notify_cancel()
        if ours:
            try:
                self._load(types)
                future.set_result(None)
            except BaseException as error:
                future.set_exception(error)
                with _LOCK:
                    del self._versions[types]  # the next call tries again
        try:
            future.result()
        except KeyboardInterrupt:
            end_all()  # or the process would go on compiling before it ends
            raise

    def _bind(self, arguments: tuple[Any, ...], named: Mapping[str, Any]) -> dict[str, Any]:
        bound = self._signature.bind(*arguments, **named)
        bound.apply_defaults()
        return dict(bound.arguments)

    def _refuse_other_axes(self, types: tuple[Type, ...]) -> None:
        """An argument that was an array of two axes once is never one of another kind; nothing is
        compiled for it.
        """
        for known, made in self._versions.items():
            if made.done() and not made.cancelled() and made.exception() is not None:
                continue
            for name, a, b in zip(self._names, known, types, strict=True):
                if not isinstance(a, Array) or isinstance(a.element, Struct):
                    continue
                if not (
                    isinstance(b, Array) and b.element == a.element and len(b.shape) == len(a.shape)
                ):
                    message = f"must be an array of {len(a.shape)} axes of {DTYPES[str(a.element)]}"
                    raise KernelError(f"{name} of {self.py_func.__name__} {message}")
            break

    def _load(self, types: tuple[Type, ...]) -> None:
        """Compile for these types, or load what was compiled before, and add it to what can be
        called.
        """
        name = self.py_func.__name__.strip("_")
        code = fingerprint(self.py_func, portable=compiler.portable())
        key = library_files.key_of(
            _translator(), code, f"{self.py_func.__module__}.{name}", repr(types)
        )

        lib = library_files.library(name, key, lambda: _entry_code(self, types))
        told = json.loads(ctypes.c_char_p.in_dll(lib, "signature").value or b"{}")
        entry = ctypes.cast(lib.entry, ctypes.c_void_p).value
        named = dict(zip(self._names, types, strict=True))
        version = Version(entry, told, named, self._shapes, release=self._release)
        with _LOCK:
            join(Kernel, chains=False)
            self._address = version.before(getattr(self, "_address", 0))
            self._kept += [lib, version]

    def c_source(self, *arguments: Any, debug: bool = False) -> str:
        """The C that arguments like these make."""
        values = self._bind(tuple(_plain(value) for value in arguments), {})
        return _entry_code(self, argument_types(self, values), debug=debug, traced=False)

    def __reduce__(self) -> str:
        return self.py_func.__qualname__

    def __repr__(self) -> str:
        return f"<kernel {self.py_func.__module__}.{self.py_func.__qualname__}>"


@overload
def kernel(function: Callable[..., Result], /) -> Kernel[Result]: ...
@overload
def kernel(
    *, release: bool = False, **shapes: Shape
) -> Callable[[Callable[..., Result]], Kernel[Result]]: ...
def kernel(function: Any = None, /, *, release: bool = False, **shapes: Shape) -> Any:
    """Make a function a kernel.

    Args:
        function: in the language of kernels (docs/kernels.md).
        release: whether other threads of Python may go on while it runs.
        shapes: for an argument that is an array its shape, which is checked where Python calls the
            kernel. An entry is a number, a name such as ``"n"`` that stands for the same number
            everywhere, a multiple of it (``"3n"``), or the least number (``"7+"``). ``"p.rate"`` in
            the place of a shape means that of a field of the argument ``p``. A number instead of an
            array is at most what a name stands for where the name is in the place of the shape.
            Sizes that are numbers, or those of a field, are constants in C.
    """
    if function is not None:
        return Kernel(function, {})
    return lambda one: Kernel(one, shapes, release=release)


_DTYPES = {dtype: dtype for dtype in DTYPES.values()}
"""The one of equal types of records that calls compare with; those that were pickled have
others.
"""


def _entry_code(
    kernel: Kernel[Any], types: tuple[Type, ...], *, debug: bool = False, traced: bool = True
) -> str:
    """A kernel as C; only here the files that translate are imported."""
    from harpy_pin.kernels.entry_points import entry_code

    with _TRANSLATING:
        return entry_code(kernel, types, debug=debug, traced=traced)


def _plain(value: Any) -> Any:
    """An argument as C can take it: a record as an array without axes."""
    if isinstance(value, np.ma.MaskedArray):
        raise KernelError("kernels know no masks")
    if isinstance(value, np.void | np.ndarray):
        array = np.asarray(value)
        dtype = _DTYPES.setdefault(array.dtype, array.dtype)
        return array if dtype is array.dtype else array.view(dtype)
    if isinstance(value, np.floating | np.integer | np.bool_):
        return float(value) if isinstance(value, np.floating) else value.item()
    if isinstance(value, tuple):
        return tuple(map(_plain, value))
    return value


def _has_gaps(value: Any) -> bool:
    return isinstance(value, np.ndarray) and not value.flags.c_contiguous


def _described(given: Mapping[str, Any]) -> str:
    def kind(value: Any) -> str:
        return (
            f"{value.dtype.kind}{value.shape}"
            if isinstance(value, np.ndarray)
            else type(value).__name__
        )

    return ", ".join(f"{name}: {kind(value)}" for name, value in given.items())


@cache
def _workers() -> ThreadPoolExecutor:
    """Compile several kernels at a time."""
    return ThreadPoolExecutor(max(os.cpu_count() or 1, 1), thread_name_prefix="harpy-compile")


def _begin_anew() -> None:
    """In a forked child, which has none of its parent's threads: what they have not finished is not
    begun.
    """
    global _LOCK, _TRANSLATING
    _LOCK, _TRANSLATING = RLock(), RLock()
    compiler.begin_anew()
    _workers.cache_clear()
    for made in _KERNELS:
        for types, future in list(made._versions.items()):
            if not future.done():
                del made._versions[types]


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_begin_anew)


def wait_for_all() -> None:
    """Wait until everything is compiled that was begun; nothing may be begun meanwhile."""
    _workers().shutdown()
    _workers.cache_clear()


def end_all() -> None:
    """End what is compiled in the background; what is needed later is begun anew."""
    with compiler.ending():
        _workers().shutdown(cancel_futures=True)
    _workers.cache_clear()


@cache
def _translator() -> bytes:
    """The translator's own source: what it writes is made anew when it changes."""
    here = Path(__file__).parent
    return b"".join(path.read_bytes() for path in (*sorted(here.glob("*.py")), here / "helpers.c"))
