"""A controller and a simulator in closed loop: an interrupt loses no tick and writes none twice."""

import os
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

import harpy_pin as hp
from harpy_pin.errors import Interrupted

FOLDER = Path(hp.__file__).parent
OWN = {
    str(FOLDER / f"{name}.py")
    for name in ("simulation/loop", "simulation/ticks", "log/recorder", "log/journal")
}


@pytest.mark.parametrize("compiled", [False, True])
def test_an_interrupt_at_any_call_keeps_every_tick_once(robot, tmp_path, compiled):
    """Wherever Python may receive it in the loop or the log: as a function begins, or after one of
    C.
    """
    gait, simulator = hp.make_gait(robot), hp.Simulator(robot)
    controller = hp.make_controller("condensed", gait, mu=0.5)
    cut, places = 0, []

    def walk(save, moment=-1):
        places.clear()

        def press(frame, event, argument):
            if frame.f_code.co_filename in OWN and event in ("call", "c_return"):
                places.append((frame.f_code.co_filename, frame.f_lineno, event))
                if len(places) - 1 == moment:
                    os.kill(os.getpid(), signal.SIGINT)

        simulator.reset(*gait.initial_state(penetration=simulator.static_penetration))
        controller.reset()
        sys.setprofile(press)
        try:
            return simulator.run(
                controller, 3e-3, on_tick=None if compiled else lambda state: None, save=save
            )
        finally:
            sys.setprofile(None)

    handler, path = signal.getsignal(signal.SIGINT), tmp_path / "run.npz"
    whole = walk(path)
    seen = list(
        places
    )  # a line that is reached several times is interrupted the first and the last time
    first, last = (
        {place: n for n, place in reversed([*enumerate(seen)])},
        {place: n for n, place in enumerate(seen)},
    )
    for moment in sorted({*first.values(), *last.values()}):
        path.unlink(missing_ok=True)
        try:
            run = walk(path, moment)
        except Interrupted as interrupt:
            run = interrupt.run
            cut += 0 < len(run) < len(whole)
        except KeyboardInterrupt:  # before the first tick
            run = None
        assert signal.getsignal(signal.SIGINT) is handler
        if run is not None and len(run) > 0:
            np.testing.assert_array_equal(run["q"], whole["q"][: len(run)])
            np.testing.assert_array_equal(hp.Run.load(path)["t"], run["t"])
        assert not (tmp_path / "run.npz.part").exists()
    assert cut > 5
