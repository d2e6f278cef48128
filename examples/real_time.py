"""A loop at 1 kHz: absolute deadlines, no garbage collection, a log that never blocks; jitter and misses printed."""

import gc
import queue
import threading
import time

import numpy as np

import harpy_pin as hp

PERIOD, SECONDS, SPIN = 1_000_000, 4.0, 150_000  # ns; s; ns before a deadline in which the loop spins
Row = tuple[float, np.ndarray]
gait = hp.make_gait(hp.load_harpy())
controller, plant = hp.make_controller("explicit", gait, mu=0.4), hp.Simulator(gait.robot, hp.Ground(mu_s=0.4))


class Log:
    """Rows go to a thread through a bounded queue; where it is full they are dropped, and counted."""

    def __init__(self, size: int = 1024) -> None:
        self.rows, self.dropped, self._queue = list[Row](), 0, queue.Queue[Row | None](size)
        self._thread = threading.Thread(target=self._write)
        self._thread.start()

    def put(self, row: Row) -> None:
        try:
            self._queue.put_nowait(row)
        except queue.Full:
            self.dropped += 1

    def close(self) -> None:
        self._queue.put(None)
        self._thread.join()

    def _write(self) -> None:
        self.rows.extend(iter(self._queue.get, None))  # or to a file, a socket, a topic


plant.reset(*gait.initial_state(sink=plant.static_sink))  # the plant stands for the hardware
plant.advance(controller.step(plant.state))  # the first tick may compile
log, laps, missed = Log(), list[tuple[int, int]](), 0
for tidy in (gc.collect, gc.freeze, gc.disable):
    tidy()
deadline = begin = time.perf_counter_ns() + 10 * PERIOD
while deadline < begin + 1e9 * SECONDS:
    time.sleep(max(deadline - time.perf_counter_ns() - SPIN, 0) * 1e-9)
    while (now := time.perf_counter_ns()) < deadline:
        pass
    plant.advance(controller.step(plant.state), steps=2)
    log.put((plant.t, plant.q.copy()))
    done = time.perf_counter_ns()
    laps.append((now - deadline, done - now))
    skipped = max((done - deadline) // PERIOD, 0)  # what has passed is not made up for
    missed, deadline = missed + skipped, deadline + (1 + skipped) * PERIOD
log.close()
for name, values in zip(("late by", "worked for"), np.array(laps).T / 1e3, strict=True):
    shown = "median {:.1f} µs, 99 % {:.1f} µs, most {:.1f} µs".format(*np.percentile(values, (50, 99, 100)))
    print(f"{name:10s} {shown}")
print(f"{missed} of {len(laps) + missed} deadlines missed, {log.dropped} rows of the log dropped")
