"""The optimum of one program, from the last tick's active set."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.model.state import Vector
from harpy_pin.wbc.active_set_warm_start import EXCHANGES, exchange
from harpy_pin.wbc.dual import dual_active_set

if TYPE_CHECKING:
    from harpy_pin.wbc.condensed.condensed_record import CondensedRecord, SearchRecord

__all__: list[str] = []


@kernel
def search_active_set(p: CondensedRecord, search: SearchRecord, z: Vector) -> None:
    """The optimum, by the last active set, its exchange, or the dual method; the status says whether one was found."""
    w, dual = search.exchange, search.dual
    systems, _ = exchange(search.program, w, z)
    p.status_and_systems[1] += systems
    if systems <= EXCHANGES:
        return
    outcome, exchanges = dual_active_set(search.program, dual, z)
    p.status_and_systems[1] += exchanges
    w.active[:] = dual.active
    finite = True
    for c in range(z.shape[0]):
        finite = finite and np.isfinite(z[c])
    if outcome == 0 and finite:
        return
    p.status_and_systems[0] |= 4
    w.active[:] = 0
    if not finite:
        z[:] = 0.0
