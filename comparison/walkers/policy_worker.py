"""Evaluates the policy; runs in a virtual environment of its own.

    python policy_worker.py WEIGHTS

It writes an empty line once it is ready. Then it answers every observation, 48 floats of 32 bits, with the action, 12
floats. Where the observation begins with NaN, the answer is the thread's time of an evaluation, µs: of many in a row,
of the observation before.
"""

from __future__ import annotations

import sys
from time import thread_time_ns

import numpy as np
import onnxruntime

OBSERVED, CALLS = 48, 200


def main() -> None:
    """Answer until the input ends."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(sys.argv[1], options, providers=["CPUExecutionProvider"])
    out = sys.stdout.buffer
    out.write(b"\n")
    out.flush()
    observation = np.zeros((1, OBSERVED), dtype=np.float32)
    while len(data := sys.stdin.buffer.read(4 * OBSERVED)) == 4 * OBSERVED:
        asked = np.frombuffer(data, dtype=np.float32).reshape(1, -1)
        if np.isnan(asked[0, 0]):
            begin = thread_time_ns()
            for _ in range(CALLS):
                session.run(["continuous_actions"], {"obs": observation})
            answer = np.full(12, 1e-3 * (thread_time_ns() - begin) / CALLS)
        else:
            observation = asked
            answer = session.run(["continuous_actions"], {"obs": observation})[0]
        out.write(np.asarray(answer, dtype=np.float32).tobytes())
        out.flush()


if __name__ == "__main__":
    main()
