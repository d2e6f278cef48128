"""Memory of objects that kernels write into: arrays that stay where they are, and copies whose
views are views again.

NumPy copies each view by itself, an attribute can be bound to any array, and an array can be given
another shape or length in place. So kernels would write into a record that no attribute shows any
more, or past the end of an array that is too short.
"""

from collections.abc import Callable
from copy import deepcopy
from operator import attrgetter
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError

_T = TypeVar("_T")
_Kind = TypeVar("_Kind", bound=type)
_Array = NDArray[Any]
ALIGNED = 64  # bytes: vectors of processors lie well there


def fixed_arrays(*names: str, copied: bool = True) -> Callable[[_Kind], _Kind]:
    """A decorator of classes: these attributes are arrays that stay where they are.

    The first assignment, in ``__init__``, makes the array an attribute. Every later one writes into
    it, after a check of its shape and of its numbers. The array is kept as ``_name_``, which code
    of every tick reads: it is faster, and its shape is fixed. The attribute is a view of its
    memory, made at each access, and that memory cannot be resized.

    Args:
        names: of the attributes.
        copied: without, an array that owns its memory is kept itself: for objects of a moment,
            whose readers check it.
    """

    def decorate(kind: _Kind) -> _Kind:
        for name in names:
            setattr(kind, name, _fixed_array(name, copied=copied))
        return kind

    return decorate


def _fixed_array(name: str, *, copied: bool) -> property:
    """An attribute that is an array, kept under another name."""
    kept = f"_{name}_"

    def write(holder: Any, value: ArrayLike) -> None:
        held = getattr(holder, kept, None)
        if held is None:  # through __dict__, every later access would be slower
            owns = copied and isinstance(value, np.ndarray) and value.base is None
            object.__setattr__(holder, kept, lasting(np.asarray(value)) if owns else _plain(value))
        elif not _same(value, held):  # which is what ``holder.array += 1`` assigns
            held[...] = _checked(name, value, held)

    array = attrgetter(kept)

    def view(holder: Any) -> Any:
        held = array(holder)
        if not isinstance(held, np.ndarray):
            return held
        if held.dtype.names is None:
            return held[...]
        from harpy_pin.kernels.record_view import (
            RecordView,
        )  # only objects that kernels work on have records

        return held.view(RecordView)

    return property(view, write, doc="An array; see the attributes of its class.")


def _plain(value: Any) -> Any:
    """An array of no other class; other values as they are."""
    return (
        value.view(np.ndarray)
        if isinstance(value, np.ndarray) and type(value) is not np.ndarray
        else value
    )


def lasting(array: _Array) -> _Array:
    """A copy of an array in memory that cannot be resized, nor can its own shape be changed through
    its ``base``.
    """
    memory = room(array.nbytes + ALIGNED)
    made = np.ndarray(array.shape, array.dtype, memory, -memory.ctypes.data % ALIGNED)
    made[...] = array
    return made


def room(size: int) -> NDArray[np.uint8]:
    """Bytes that NumPy does not own, so that it refuses to resize them."""
    return np.ndarray((size,), np.uint8, bytearray(size))


def _same(value: Any, held: _Array) -> bool:
    """Whether a value is the held array, or a view of all of it."""
    return (
        isinstance(value, np.ndarray)
        and value.shape == held.shape
        and value.ctypes.data == held.ctypes.data
    )


def move_array(holder: Any, name: str, array: _Array) -> None:
    """Make a fixed attribute another array: for whoever owns both, and tells the kernels."""
    object.__setattr__(holder, f"_{name}_", array)


def shares_memory(holder: _T) -> _T:
    """A second object with the attributes of one, and the same memory."""
    made: _T = object.__new__(type(holder))
    for name, value in vars(holder).items():
        object.__setattr__(made, name, value)
    return made


def _checked(name: str, value: ArrayLike, held: _Array) -> _Array:
    """What may be written into an array: finite numbers of its shape and kind."""
    if held.dtype.names or not held.flags.writeable:
        raise InputError(f"{name} is read only", name=name, value=value)
    if held.dtype.kind == "f":
        return checks.vector(name, value, held.shape)
    given = np.asarray(value)
    if given.shape != held.shape or not np.can_cast(given.dtype, held.dtype, "same_kind"):
        raise InputError(
            f"{name} must have shape {held.shape} and type {held.dtype}, got {given.shape} "
            f"and {given.dtype}",
            name=name,
            value=value,
        )
    return given


class KeepsViews:
    """Base of objects that share memory with each other or with views of their own.

    ``copy.copy`` and ``copy.deepcopy`` both give an object with memory of its own; ``pickle``
    works, too.
    """

    __slots__ = ()
    _rebuilt: ClassVar[tuple[str, ...]] = ()
    """Attributes that a copy makes for itself, in :meth:`_rebuild`."""

    def _rebuild(self) -> None:
        """Make what is not copied."""

    def __copy__(self) -> Self:
        return deepcopy(self)

    def __reduce__(self) -> tuple[Any, ...]:
        slots = [name for kind in type(self).__mro__ for name in getattr(kind, "__slots__", ())]
        state = {
            name: getattr(self, name)
            for name in slots
            if name != "__weakref__" and hasattr(self, name)
        }
        state |= getattr(self, "__dict__", {})
        kept = {name: _packed(state[name]) for name in state.keys() - {*self._rebuilt}}
        return object.__new__, (type(self),), kept

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, value)
        self._rebuild()


class _Part:
    """An array that is a part of another one, or all of it, on its way through a copy or a
    pickle.
    """

    def __init__(self, part: _Array) -> None:
        array = part
        while isinstance(array.base, np.ndarray):
            array = array.base
        owner = array.base if isinstance(array.base, bytearray) else array
        offset = int(part.__array_interface__["data"][0] - array.__array_interface__["data"][0])
        self._arguments: tuple[Any, ...] = (
            owner,
            part.dtype,
            part.shape,
            offset,
            part.strides,
            part.flags.writeable,
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return _part_of, self._arguments


def _packed(value: Any) -> Any:
    """A value in which arrays that are parts of others say so."""
    if isinstance(value, np.ndarray):
        return _Part(value)
    if type(value) in (list, tuple):
        return type(value)(_packed(entry) for entry in value)
    if type(value) is dict:
        return {_packed(key): _packed(entry) for key, entry in value.items()}
    return value


def _part_of(
    owner: _Array | bytearray,
    dtype: np.dtype[Any],
    shape: tuple[int, ...],
    offset: int,
    strides: tuple[int, ...],
    writeable: bool,
) -> _Array:
    """The part of an array, or of bytes."""
    whole = np.ndarray((len(owner),), np.uint8, owner) if isinstance(owner, bytearray) else owner
    part: _Array = np.ndarray(shape, _DTYPES.setdefault(dtype, dtype), whole, offset, strides)
    part.flags.writeable = writeable and whole.flags.writeable
    return part


_DTYPES: dict[np.dtype[Any], np.dtype[Any]] = {}
"""One object for equal types of records, which a call of a kernel compares at a glance; a pickle
brings others.
"""
