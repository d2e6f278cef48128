"""Ticks keep nothing: after a warm-up, thousands of them leave no memory behind."""

import gc
import tracemalloc

import pytest

import harpy_pin as hp
from harpy_pin.controllers import CONTROLLERS, GOVERNORS

KINDS = {
    **{name: hp.Scenario(controller=name).controller for name in CONTROLLERS if name != "governed"},
    **{f"governed, {name}": hp.Governed(governor=name) for name in GOVERNORS},
    "estimating": hp.Condensed(parameters={"estimate_friction": True}),
}


@pytest.mark.parametrize("name", KINDS)
def test_ticks_leave_no_memory_behind(name):
    walk = hp.build(hp.Scenario(controller=KINDS[name], ground=hp.Ground(mu_s=0.3), duration=0.5))
    states: list[hp.State] = []
    walk.run(on_tick=lambda state: states.append(state.copy()))
    step = walk.controller.step

    def ticks(rounds: int) -> None:
        for _ in range(rounds):
            for state in states:
                step(state)

    ticks(1)
    tracemalloc.start()
    try:
        ticks(2)
        for _ in range(
            3
            # what ticks keep grows each time; a message to pytest's worker, in another thread, does
            # not
        ):
            gc.collect()
            before = tracemalloc.get_traced_memory()[0]
            ticks(6)
            gc.collect()
            grown = tracemalloc.get_traced_memory()[0] - before
            if grown < 2000:
                return
    finally:
        tracemalloc.stop()
    pytest.fail(f"{grown} bytes are kept; one number kept at each of 3,000 ticks would be 72,000")
