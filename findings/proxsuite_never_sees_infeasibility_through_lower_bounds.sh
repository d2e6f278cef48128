#!/usr/bin/env bash
# ProxSuite 0.8.0, proxqp.dense, cold: a'x >= 1 together with -a'x >= 1 has no solution. Written as
# lower bounds it ends in PROXQP_MAX_ITER_REACHED in 100 of 100 random programs, after every iteration
# that was allowed; the same rows as upper bounds end in PROXQP_PRIMAL_INFEASIBLE in 100 of 100.
# Seen: lower {'MAX_ITER_REACHED': 100}, upper {'PRIMAL_INFEASIBLE': 100}
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q proxsuite==0.8.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'END'
from collections import Counter

import numpy as np
from proxsuite import proxqp

rng = np.random.default_rng(0)
found = {"lower": Counter(), "upper": Counter()}
for _ in range(100):
    n = int(rng.integers(2, 6))
    gradient, along = rng.normal(size=n), rng.normal(size=n)
    rows, ones, free = np.vstack((along, -along)), np.ones(2), np.full(2, 1e20)
    for side, bounds in {"lower": (rows, ones, free), "upper": (-rows, -free, -ones)}.items():
        qp = proxqp.dense.QP(n, 0, 2)
        qp.settings.max_iter = 1000
        qp.init(np.eye(n), gradient, None, None, *bounds)
        qp.solve()
        found[side][str(qp.results.info.status).partition("PROXQP_")[2]] += 1
print({side: dict(counted) for side, counted in found.items()})
assert found["lower"]["PRIMAL_INFEASIBLE"] == 0
assert found["upper"]["PRIMAL_INFEASIBLE"] == 100
END
