"""The reference: every public name is in it, and says what its parameters are."""

import enum
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import harpy_pin as hp

ROOT = Path(__file__).resolve().parents[2]
ELSEWHERE = re.compile(r"\bsee :(?:class|func|meth):`", re.I)
"""In docstrings whose parameters are those of another function, which they name."""


def public_names() -> Iterator[tuple[str, Any]]:
    """Every name of the package and of its packages, an object of several names once, under its
    shortest.
    """
    seen: set[int] = set()
    packages = []
    for name in hp.__all__:
        value = getattr(hp, name)
        if isinstance(value, ModuleType):
            packages.append((name, value))
        elif name != "__version__":
            seen.add(id(value))
            yield name, value
    for package, module in packages:
        for name in module.__all__:
            value = getattr(module, name)
            if id(value) not in seen:
                seen.add(id(value))
                yield f"{package}.{name}", value


PUBLIC = dict(public_names())


def described(docstring: str, *sections: str) -> set[str]:
    """Names that sections such as ``Args`` hold."""
    bodies = re.findall(rf"^(?:{'|'.join(sections)}):\n((?: +.*\n?|\n)+)", docstring, re.M)
    return {name for body in bodies for name in re.findall(r"^ {4}\*{0,2}(\w+):", body, re.M)}


def parameters(function: Any) -> set[str]:
    """What a caller may give, but for catch-alls that are refused."""
    return {
        name for name in inspect.signature(function).parameters if name not in ("self", "cls", "_")
    }


def functions_of(kind: type) -> Iterator[tuple[str, Any]]:
    """Public methods that a class defines itself."""
    for name, value in vars(kind).items():
        function = getattr(value, "__func__", value)
        if not name.startswith("_") and (
            inspect.isfunction(function) or isinstance(value, property)
        ):
            yield name, function


@pytest.mark.parametrize("name", PUBLIC)
def test_parameters_are_described(name):
    value = PUBLIC[name]
    if inspect.isclass(value):
        docstring = inspect.cleandoc(value.__doc__ or "")
        assert docstring
        if not (
            issubclass(value, BaseException | enum.Enum) or getattr(value, "_is_protocol", False)
        ):
            bases = (
                inspect.cleandoc(one.__doc__ or "")
                for one in value.__mro__
                if one in PUBLIC.values()
            )
            assert parameters(value) <= set().union(
                *(described(text, "Args", "Attributes") for text in bases)
            )
        for method, function in functions_of(value):
            text = inspect.getdoc(function) or ""
            assert text, method
            if not isinstance(function, property) and not ELSEWHERE.search(text):
                assert parameters(function) <= described(text, "Args"), method
    elif inspect.isfunction(inspect.unwrap(value)) or hasattr(value, "py_func"):
        docstring = inspect.getdoc(value) or ""
        assert docstring
        if not ELSEWHERE.search(docstring):
            assert parameters(inspect.unwrap(value)) <= described(docstring, "Args")


def test_the_check_sees_what_is_missing():
    text = "Does it.\n\nArgs:\n    first: one.\n\nRaises:\n    InputError: other.\n"
    assert described(text, "Args") == {"first"}
    assert described("Does it with first and second.", "Args") == set()
    assert parameters(lambda self, first, *, second: None) == {"first", "second"}


def test_every_name_is_in_the_reference():
    pages = (ROOT / "docs" / "reference").glob("*.md")
    entries = [
        name
        for page in pages
        for name in re.findall(r"^::: harpy_pin\.(\S+)$", page.read_text(), re.M)
    ]
    assert len(entries) == len(set(entries))
    assert set(PUBLIC) <= set(entries)
