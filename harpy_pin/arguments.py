"""Arguments are what their annotations say: a decorator of functions that are not called in every
tick.

It sees to kinds only, such as a robot, a number, a mapping. Ranges and shapes are for the function
itself.
"""

import inspect
import math
import types
from collections.abc import Callable, Mapping, Sequence
from functools import cache, wraps
from os import PathLike
from pathlib import Path
from typing import Any, Literal, NamedTuple, ParamSpec, TypeVar, Union, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError, shown

_P = ParamSpec("_P")
_T = TypeVar("_T")


class _Kind(NamedTuple):
    """What an argument may be: in words, and whether a value is that."""

    words: str
    fits: Callable[[Any], bool]
    members: tuple[str, ...] = ()

    def refuse(self, name: str, value: Any) -> InputError:
        """The error of a value that is something else."""
        missing = ", ".join(member for member in self.members if not hasattr(value, member))
        found = f"{type(value).__name__} has no {missing}" if missing else f"got {shown(value)}"
        return InputError(f"{name} must be {self.words}, {found}", name=name, value=value)


def checked(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """Refuse arguments of another kind than the annotations say, before the function is called.

    An annotation that this module does not know, or that exists for type checkers only, allows
    everything. A protocol asks for its public members. What is refused is an :class:`InputError`. A
    ``staticmethod`` or ``classmethod`` around the function comes outside.
    """
    names = tuple(inspect.signature(function).parameters)

    @wraps(function)
    def call(*arguments: _P.args, **named: _P.kwargs) -> _T:
        kinds = _kinds(function)
        for name, value in (*zip(names, arguments, strict=False), *named.items()):
            kind = kinds.get(name)
            if kind is not None and not kind.fits(value):
                raise kind.refuse(name, value)
        return function(*arguments, **named)

    return call


@cache
def _kinds(function: Callable[..., Any]) -> dict[str, _Kind]:
    """What the arguments of a function may be, by name."""
    found = {}
    for name, parameter in inspect.signature(function).parameters.items():
        try:
            annotation = eval(str(parameter.annotation), function.__globals__)
        except (NameError, AttributeError, SyntaxError):  # for type checkers only
            continue
        kind = _kind(annotation)
        if kind is not None and parameter.kind not in (
            parameter.VAR_POSITIONAL,
            parameter.VAR_KEYWORD,
        ):
            found[name] = kind
    return found


def _kind(annotation: Any) -> _Kind | None:
    """What an annotation allows; None for everything."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if annotation in _SIMPLE:
        return _SIMPLE[annotation]
    if annotation in (ArrayLike, Any, object) or isinstance(annotation, TypeVar):
        return _ARRAY if annotation is ArrayLike else None
    if origin in (Union, types.UnionType):
        return _any_of(parts)
    if origin is Literal:
        return _Kind(
            " or ".join(map(repr, parts)), lambda value: isinstance(value, str) and value in parts
        )
    if origin is tuple and parts and all(part is float for part in parts):
        return _Kind(
            f"{len(parts)} numbers", lambda value: _passes(checks.array, value, (len(parts),))
        )
    if origin is np.ndarray:
        return {np.dtype[np.float64]: _ARRAY, np.dtype[np.void]: _RECORD}.get(parts[1])
    return _SIMPLE.get(origin) if origin is not None else _object(annotation)


def _any_of(parts: tuple[Any, ...]) -> _Kind | None:
    """What one of several annotations allows."""
    kinds = [_kind(part) for part in parts]
    known = [kind for kind in kinds if kind is not None]
    if len(known) < len(kinds):
        return None
    words = dict.fromkeys(kind.words for kind in known)  # two annotations may say the same
    return _Kind(" or ".join(words), lambda value: any(kind.fits(value) for kind in known))


def _object(annotation: Any) -> _Kind | None:
    """An object of a class, or one with the members of a protocol."""
    if not inspect.isclass(annotation):
        return None
    if not getattr(annotation, "_is_protocol", False):
        return _Kind(f"a {annotation.__name__}", lambda value: isinstance(value, annotation))
    parents = [parent for parent in annotation.__mro__ if getattr(parent, "_is_protocol", False)]
    members = dict.fromkeys(
        name for parent in parents for name in (*inspect.get_annotations(parent), *vars(parent))
    )
    desired = tuple(name for name in members if not name.startswith("_"))
    words = f"a {annotation.__name__} with {', '.join(desired)}"
    return _Kind(
        words,
        lambda value: not inspect.isclass(value) and all(hasattr(value, name) for name in desired),
        desired,
    )


def _passes(check: Callable[..., object], *arguments: Any, **bounds: Any) -> bool:
    """Whether a check of :mod:`harpy_pin.checks` lets a value through."""
    try:
        check("", *arguments, **bounds)
    except InputError:
        return False
    return True


def _is_number(value: Any) -> bool:
    """Whether a value is one real number, NaN and infinity included."""
    return isinstance(value, float | np.floating) or _passes(checks.number, value)


_ARRAY = _Kind("an array of numbers", lambda value: _passes(checks.array, value, None))
_RECORD = _Kind(
    "a record", lambda value: isinstance(value, np.ndarray) and value.dtype.names is not None
)
_PATH = _Kind("a path", lambda value: isinstance(value, str | PathLike))
_SIMPLE: dict[Any, _Kind] = {
    float: _Kind("a number", _is_number),
    int: _Kind("a whole number", lambda value: _passes(checks.whole, value, low=-math.inf)),
    bool: _Kind(
        "True or False", lambda value: isinstance(value, int | np.bool_) and value in (0, 1)
    ),
    str: _Kind("a name", lambda value: isinstance(value, str)),
    types.NoneType: _Kind("None", lambda value: value is None),
    PathLike: _PATH,
    Path: _PATH,
    Callable: _Kind("a function", callable),
    Mapping: _Kind("a mapping", lambda value: isinstance(value, Mapping)),
    dict: _Kind("a mapping", lambda value: isinstance(value, Mapping)),
    Sequence: _Kind(
        "a sequence",
        lambda value: isinstance(value, Sequence) and not isinstance(value, str | bytes),
    ),
}
"""Annotations without parameters, and origins of those with some."""
