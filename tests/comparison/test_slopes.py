"""The bound of statics against closed forms, and the study of slopes in small."""

from __future__ import annotations

import numpy as np
import pytest

from comparison.slopes import SlopeSettings, slope_tables, stand_on_slopes, static_bound

WEIGHT = 4.02 * 9.81


@pytest.mark.parametrize(("degrees", "friction"), [(10.0, 0.2), (10.0, 0.15), (20.0, 0.4), (20.0, 0.3)])
def test_without_thrust_it_stands_up_to_the_angle_of_friction(degrees, friction):
    without, least = static_bound(degrees, friction)
    assert without == (np.tan(np.radians(degrees)) <= friction)
    assert least is not None
    assert (least < 1e-6) == without


def test_little_thrust_is_what_friction_lacks():
    """Thrust along x at the feet's line alone would be W (tan θ − μ) / (1 + μ tan θ); the bound needs no less."""
    least = static_bound(15.0, 0.2)[1]
    tangent = np.tan(np.radians(15.0))
    assert least is not None
    assert WEIGHT * (tangent - 0.2) / (1.0 + 0.2 * tangent) == pytest.approx(least, rel=0.02)


def test_a_small_study():
    settings = SlopeSettings(degrees=(0.0, 15.0), frictions=(0.8,), walkers=("condensed",), duration=0.5)
    rows = stand_on_slopes(settings)
    assert [row["fell"] for row in rows] == [False, False]
    assert max(row["slip_mm"] for row in rows) < 1.0
    names = [table.name for table in slope_tables(rows)]
    assert names == ["slopes_statics", "slopes_condensed", "slopes"]
