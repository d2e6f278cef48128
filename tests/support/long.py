"""Cases of a test, of which some take too long for every run."""

from collections.abc import Iterable
from typing import Any

import pytest


def long_but(cases: Iterable[Any], always: Iterable[Any]) -> list[Any]:
    """Parameters of a test; those that are not in ``always`` are marked ``long``."""
    kept = list(always)
    return [
        pytest.param(
            *(case if isinstance(case, tuple) else (case,)),
            marks=() if case in kept else pytest.mark.long,
        )
        for case in cases
    ]
