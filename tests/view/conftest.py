"""What gaits of the live view share."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from harpy_pin.gaits.commanded import CommandedGait


@pytest.fixture(scope="module", autouse=True)
def reach_is_found_once() -> Iterator[None]:
    """The reach of legs takes most of the time to make a session, and is the same for the same robot and gait."""
    found: dict[Any, tuple[Any, float]] = {}
    reach = CommandedGait._reach

    def known(gait: CommandedGait) -> float:
        key = id(gait.robot), gait.parameters
        if key not in found:
            found[key] = gait.robot, reach(gait)
        return found[key][1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(CommandedGait, "_reach", known)
        yield
