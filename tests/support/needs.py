"""What a test needs and an installation may lack."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec

import pytest

from harpy_pin.model.catalogue import installed_data

needs_robots = pytest.mark.skipif(
    installed_data() is None, reason="the robots are an extra: pip install 'harpy-pin[robots]'"
)


def needs_drake(test: Callable[..., None]) -> Callable[..., None]:
    """Mark a test that needs Drake, an extra of 400 MB: it runs with ``--long``."""
    missing = find_spec("pydrake") is None
    skipped = pytest.mark.skipif(missing, reason="Drake is an extra: pip install 'harpy-pin[drake]'")
    marked: Callable[..., None] = pytest.mark.long(skipped(test))
    return marked
