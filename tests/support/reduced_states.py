"""States and references of the reduced-order model, for hypothesis."""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from reproduction.vlip_simulation import cartesian


def states():
    """(9,) [c; ċ; u] with a leg of ordinary length and lean."""
    return st.builds(
        lambda theta, phi, length, foot, rate: np.concatenate((foot + cartesian(theta, phi, length), rate, foot)),
        st.floats(0.01, 1.2),
        st.floats(-np.pi, np.pi),
        st.floats(0.2, 0.9),
        arrays(np.float64, 3, elements=st.floats(-1.0, 1.0)),
        arrays(np.float64, 3, elements=st.floats(-1.0, 1.0)),
    )


def references():
    """(6,) [c; ċ]."""
    return arrays(np.float64, 6, elements=st.floats(-1.0, 1.0))
