"""Terrains: heights and normals against their definitions, their form in files, and what they
refuse.
"""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import harpy_pin as hp
from harpy_pin.errors import InputError
from harpy_pin.ground.surface import MAX_CELLS
from harpy_pin.ground.terrain import (
    TERRAINS,
    HeightField,
    Plane,
    Ramp,
    Rough,
    Stairs,
    Terrain,
    read_terrain,
)

WAVES = HeightField(
    heights=tuple(tuple(0.1 * np.sin(i) * np.cos(2.0 * j) for j in range(9)) for i in range(7)),
    resolution=0.2,
    corner=(-0.3, 0.4),
)
EXAMPLES = (
    Plane(slope=0.3, heading=0.7),
    Ramp(slope=-0.2, start=0.1, length=0.7),
    Stairs(rise=0.04, depth=0.25, steps=32, start=-0.2),
    Rough(amplitude=0.05, seed=3),
    WAVES,
)
FLAT = (Plane(), Plane(heading=1.0), Ramp(slope=0.0), Stairs(rise=0.0), Rough(amplitude=0.0))
places = st.floats(-20.0, 20.0)


def own_height(terrain: Terrain, x: float, y: float) -> float:
    """The height as the docstrings of the kinds say it."""
    if isinstance(terrain, Plane):
        return float(
            np.tan(terrain.slope) * (x * np.cos(terrain.heading) + y * np.sin(terrain.heading))
        )
    if isinstance(terrain, Ramp):
        return float(np.tan(terrain.slope) * np.clip(x - terrain.start, 0.0, terrain.length))
    if isinstance(terrain, Stairs):
        risers = terrain.start + terrain.depth * np.arange(terrain.steps)
        return float(terrain.rise * np.clip((x - risers) / terrain.edge, 0.0, 1.0).sum())
    if isinstance(terrain, HeightField):
        heights = np.array(terrain.heights)
        u, v = ((p - c) / terrain.resolution for p, c in zip((x, y), terrain.corner, strict=True))
        u, v = np.clip(u, 0, len(heights) - 1), np.clip(v, 0, heights.shape[1] - 1)
        a, b = min(int(u), len(heights) - 2), min(int(v), heights.shape[1] - 2)
    else:
        assert isinstance(terrain, Rough)
        draw = np.random.default_rng(terrain.seed).uniform(-1.0, 1.0, (MAX_CELLS, MAX_CELLS))
        heights = np.pad(terrain.amplitude * draw, ((0, 1), (0, 1)), mode="wrap")
        u, v = np.mod(x / terrain.resolution, MAX_CELLS), np.mod(y / terrain.resolution, MAX_CELLS)
        a, b = min(int(u), MAX_CELLS - 1), min(int(v), MAX_CELLS - 1)
    u, v = u - a, v - b
    low = (1 - u) * heights[a, b] + u * heights[a + 1, b]
    high = (1 - u) * heights[a, b + 1] + u * heights[a + 1, b + 1]
    return float((1 - v) * low + v * high)


@pytest.mark.parametrize("terrain", EXAMPLES, ids=lambda terrain: terrain.name)
@given(x=places, y=places)
def test_height_is_the_one_defined(terrain, x, y):
    assert float(terrain.height(x, y)) == pytest.approx(own_height(terrain, x, y), abs=1e-9)


@pytest.mark.parametrize("terrain", EXAMPLES, ids=lambda terrain: terrain.name)
@given(x=st.floats(-2.0, 2.0), y=st.floats(-2.0, 2.0))
def test_normal_is_across_the_surface(terrain, x, y):
    """By differences of the height, away from the edges of pieces and cells."""
    step = 1e-6
    around = [
        terrain.height(x + a * step, y + b * step) for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1))
    ]
    ahead, behind, left, right = (float(h) for h in around)
    here = float(terrain.height(x, y))
    if max(abs(ahead + behind - 2 * here), abs(left + right - 2 * here)) > 1e-11:
        return
    across = np.array([-(ahead - behind) / (2 * step), -(left - right) / (2 * step), 1.0])
    np.testing.assert_allclose(terrain.normal(x, y), across / np.linalg.norm(across), atol=1e-6)


@pytest.mark.parametrize("terrain", [*EXAMPLES, *FLAT], ids=str)
def test_form_in_files(terrain):
    read = read_terrain(json.loads(json.dumps(terrain.to_dict())))
    assert read == terrain
    assert read.record.tobytes() == terrain.record.tobytes()


@pytest.mark.parametrize("terrain", FLAT, ids=str)
def test_no_slope_is_flat_ground(terrain):
    assert terrain.record["level"][0] == 1
    for ground in (hp.Ground(terrain=terrain), hp.Ground(slope=0.0)):
        assert ground.record.tobytes() == hp.Ground().record.tobytes()
    np.testing.assert_array_equal(terrain.height([0.3, -2.0], [1.0, 5.0]), [0.0, 0.0])
    np.testing.assert_array_equal(terrain.normal(0.3, 1.0), [0.0, 0.0, 1.0])


def test_all_kinds_have_one_layout():
    assert len({terrain.record.dtype for terrain in EXAMPLES}) == 1
    assert set(TERRAINS) == {terrain.name for terrain in EXAMPLES}


def test_slope_is_a_plane():
    assert (
        hp.Ground(slope=0.2).record.tobytes()
        == hp.Ground(terrain=Plane(slope=0.2)).record.tobytes()
    )
    assert hp.Ground(slope=0.2).surface == Plane(slope=0.2)
    assert hp.Ground().surface is None


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: hp.Ground(slope=0.1, terrain=Plane(slope=0.1)), "a slope or a terrain, not both"),
        (lambda: hp.Ground(terrain="hills"), "valid names: height_field, plane"),
        (lambda: hp.Ground(terrain=3), "terrain must be one of"),
        (
            lambda: hp.Ground(terrain={"name": "plane", "angle": 0.1}),
            "setting of the terrain 'plane'",
        ),
        (lambda: hp.Ground(terrain={"name": "height_field"}), "terrain 'height_field'"),
        (lambda: hp.Ground(terrain={"slope": 0.1}), "terrain"),
        (lambda: Plane().height([0.0, 1.0], [0.0]), "one shape"),
    ],
)
def test_bad_terrains_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()
