"""What a test needs and an installation may lack."""

import pytest

from harpy_pin.model.catalogue import installed_data
from harpy_pin.simulation.mujoco import installed_version

needs_robots = pytest.mark.skipif(installed_data() is None, reason="the robots are the extra robots")
needs_mujoco = pytest.mark.skipif(installed_version() is None, reason="MuJoCo is the extra mujoco")
QUICK_PLANTS = ("compliant", pytest.param("mujoco", marks=needs_mujoco))
"""Plants by name that walk for seconds within a second, for tests of both."""
PLANTS = (*QUICK_PLANTS, "pinocchio")
"""Plants by name, for tests of all."""
