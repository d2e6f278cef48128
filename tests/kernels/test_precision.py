"""Constants that are other numbers in single precision."""

from harpy_pin.kernels import ByPrecision, kernel
from harpy_pin.kernels.entry_points import entry_code
from harpy_pin.kernels.types import REAL

NEAR = ByPrecision(1e-9, single=1e-4)


@kernel
def is_near(x: float) -> bool:
    return abs(x) < NEAR


def test_a_constant_by_precision():
    assert NEAR == 1e-9
    for single, number in ((False, "1e-09"), (True, "0.0001f")):
        assert f"#define NEAR {number}\n" in entry_code(is_near, (REAL,), single=single)
    assert is_near(9e-10)
    assert not is_near(2e-9)
