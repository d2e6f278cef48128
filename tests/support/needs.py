"""What a test needs and an installation may lack."""

from __future__ import annotations

import pytest

from harpy_pin.model.catalogue import installed_data

needs_robots = pytest.mark.skipif(
    installed_data() is None, reason="the robots are an extra: pip install 'harpy-pin[robots]'"
)
