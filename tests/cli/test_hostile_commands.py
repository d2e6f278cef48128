"""Command lines drawn from a seed, for all three programs: no traceback, and one line for every
error.

Nothing is walked: where a command would begin to, its arguments have been accepted. ``--fuzz 20``
is 2,000 lines.
"""

import numpy as np
import pytest
from command_lines import commands
from hostile import choose
from hostile_lines import draw, nothing_works, run_line

LINES = 100


@pytest.mark.filterwarnings("ignore")
def test_hostile_lines(tmp_path, fuzz):
    rng, table = np.random.default_rng(1), list(commands())
    assert len(table) > 25
    with nothing_works(tmp_path):
        for _ in range(LINES * fuzz):
            run_line(draw(rng, choose(rng, table)))
