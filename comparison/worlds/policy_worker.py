"""Evaluates the policy; runs in a virtual environment of its own.

    python policy_worker.py WEIGHTS

It writes an empty line once it is ready. Then it answers every observation, 48 floats of 32 bits,
with the action, 12 floats.
"""

import sys

import numpy as np
import onnxruntime

OBSERVED = 48


def main() -> None:
    """Answer until the input ends."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(sys.argv[1], options, providers=["CPUExecutionProvider"])
    out = sys.stdout.buffer
    out.write(b"\n")
    out.flush()
    while len(data := sys.stdin.buffer.read(4 * OBSERVED)) == 4 * OBSERVED:
        observation = np.frombuffer(data, dtype=np.float32).reshape(1, -1)
        out.write(
            session.run(["continuous_actions"], {"obs": observation})[0]
            .astype(np.float32)
            .tobytes()
        )
        out.flush()


if __name__ == "__main__":
    main()
