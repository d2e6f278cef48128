"""A loop at 1 kHz with absolute deadlines and a log that never blocks; prints jitter and misses."""

import gc
import queue
import time
from threading import Thread

import numpy as np

import harpy_pin as hp

PERIOD, SECONDS, SPIN = 1_000_000, 4.0, 150_000  # ns; s; ns before a deadline in which it spins
Row = tuple[float, np.ndarray]

gait = hp.make_gait(hp.load_harpy())
plant = hp.Simulator(gait.robot)  # stands for the hardware
controller = hp.make_controller("condensed", gait, mu=0.25)


class Log:
    """Rows go to a thread through a bounded queue; when it is full they are dropped and counted."""

    def __init__(self, size: int = 1024) -> None:
        self.rows: list[Row] = []
        self.dropped, self._queue = 0, queue.Queue[Row | None](size)
        self._thread = Thread(target=self.rows.extend, args=(iter(self._queue.get, None),))
        self._thread.start()  # it may write to a file, a socket, a topic

    def put(self, row: Row) -> None:
        try:
            self._queue.put_nowait(row)
        except queue.Full:
            self.dropped += 1

    def close(self) -> None:
        self._queue.put(None)
        self._thread.join()


plant.reset(*gait.initial_state(penetration=plant.static_penetration))
plant.advance(controller.step(plant.state))  # the first tick may compile
log, laps, missed = Log(), [], 0
gc.freeze()
gc.disable()
deadline = begin = time.perf_counter_ns() + 10 * PERIOD
while deadline < begin + 1e9 * SECONDS:
    time.sleep(max(deadline - time.perf_counter_ns() - SPIN, 0) * 1e-9)
    while (now := time.perf_counter_ns()) < deadline:
        pass
    plant.advance(controller.step(plant.state), steps=2)
    log.put((plant.t, plant.q.copy()))
    done = time.perf_counter_ns()
    laps.append((now - deadline, done - now))
    passed = max((done - deadline) // PERIOD, 0)  # what has passed is not made up for
    missed, deadline = missed + passed, deadline + (1 + passed) * PERIOD
log.close()
for name, values in zip(("late by", "worked for"), np.array(laps).T / 1e3, strict=True):
    p50, p99, most = np.percentile(values, (50, 99, 100))
    print(f"{name:10s} median {p50:.1f} µs, 99 % {p99:.1f} µs, most {most:.1f} µs")
print(f"{missed} of {len(laps) + missed} deadlines missed, {log.dropped} rows of the log dropped")
