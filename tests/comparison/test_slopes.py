"""The bound of statics against closed forms, and the study of slopes in small."""

import numpy as np
import pytest
from needs import needs_robots
from PIL import Image

from comparison.cli.studies import STUDIES
from comparison.studies.slopes import static_bound, what_happens

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


@needs_robots
@pytest.mark.parametrize(("name", "degrees"), [("go2", 10.0), ("go2", 30.0), ("g1", 10.0)])
def test_robots_without_thrusters_stand_up_to_the_angle_of_friction(name, degrees):
    tangent = np.tan(np.radians(degrees))
    assert static_bound(degrees, 0.98 * tangent, name) == (False, None)
    assert static_bound(degrees, 1.02 * tangent, name) == (True, 0.0)


@needs_robots
def test_go2_topples_on_steep_ground():
    """However rough that is: no place that its legs reach is above its feet."""
    assert static_bound(65.0, 10.0, "go2") == (False, None)


@needs_robots
def test_the_map_is_drawn(tmp_path):
    small = {"degrees": (0.0, 30.0), "frictions": (0.1, 0.8), "walkers": ("no_thrust", "go2"), "duration": 0.2}
    rows = STUDIES["slopes"].run(**small)
    happens = {(row["walker"], row["degrees"], row["friction"]): what_happens(row) for row in rows}
    assert happens["no_thrust", 0.0, 0.8] == happens["go2", 0.0, 0.8] == "stands"
    assert happens["go2", 30.0, 0.1] in ("not possible", "stands")  # within 0.2 s it may slide little
    STUDIES["slopes"].figure(rows).savefig(tmp_path / "map.png")
    assert Image.open(tmp_path / "map.png").size[0] > 400
