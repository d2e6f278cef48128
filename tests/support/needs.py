"""What a test needs and an installation may lack."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

from harpy_pin.model.catalogue import installed_data

needs_drake = pytest.mark.skipif(
    find_spec("pydrake") is None, reason="Drake is an extra: pip install 'harpy-pin[drake]'"
)
needs_robots = pytest.mark.skipif(
    installed_data() is None, reason="the robots are an extra: pip install 'harpy-pin[robots]'"
)
