"""A function of C, and what is known of it before it is complete."""

from __future__ import annotations

from dataclasses import dataclass, field

from harpy_pin.compiled.types import NOTHING, Scalar, Type

__all__ = ["CFunction", "Learnt", "Wider"]


class Wider(Exception):
    """Something was learnt that what is written already depends on: start again."""


@dataclass
class Learnt:
    """What is known of a function from earlier attempts to translate it.

    Attributes:
        ranks: of variables that are numbers, the type that holds every value.
        arguments: the same of arguments that are numbers of a narrower type at first.
        result: the type of the result, once there is one.
        memory: of variables that are arrays, the arguments and fields that they may stand for.
        unsettled: by the line of a loop, names that stand for different things from one round to the next.
    """

    ranks: dict[str, Scalar] = field(default_factory=dict)
    arguments: dict[str, Scalar] = field(default_factory=dict)
    result: list[Type] = field(default_factory=list)
    memory: dict[str, tuple[frozenset[str], frozenset[str]]] = field(default_factory=dict)
    unsettled: dict[int, set[str]] = field(default_factory=dict)


@dataclass
class CFunction:
    """A kernel in C, for one set of types.

    Attributes:
        name: in C.
        parameters: names and types, with sizes that are known at run time named.
        sizes: the names of those sizes that the body uses; they are parameters, too.
        result: what it returns.
        written: parameters whose memory it writes.
        head: of its declaration.
        text: all of it.
    """

    name: str
    parameters: list[tuple[str, Type]]
    sizes: set[str] = field(default_factory=set)
    result: Type = NOTHING
    written: set[str] = field(default_factory=set)
    head: str = ""
    text: str = ""
