"""The optimised gait in the plane: how it walks, how it was found, how periodic and stable it is."""

from __future__ import annotations

from harpy_pin.gaits.planar.gait_file import PACKAGED_GAIT, PAPER_CURVES_GAIT, SPACE_GAIT, load_gait
from harpy_pin.gaits.planar.planar_model import PlanarModel
from harpy_pin.gaits.planar.planar_walk import PlanarWalk
from harpy_pin.model.robot import Robot
from harpy_pin.simulation.ground import Ground
from reproduction.gait.periodicity import analyse_periodicity

__all__ = ["study_gait"]

DURATION = 30.0


def study_gait(robot: Robot) -> dict[str, str]:
    """What the packaged planar gaits do without thrust, in words and numbers, by heading."""
    model = PlanarModel.from_robot(robot)
    rows: dict[str, str] = {}
    for title, path, mu in (
        ("planar, friction 0.25", PACKAGED_GAIT, 0.25),
        ("planar, friction 0.8", PACKAGED_GAIT, 0.8),
        ("optimised (refined for space), friction 0.25", SPACE_GAIT, 0.25),
        ("optimised (refined for space), friction 0.8", SPACE_GAIT, 0.8),
        ("paper-curves, friction 0.8", PAPER_CURVES_GAIT, 0.8),
        ("paper-curves, friction 0.25", PAPER_CURVES_GAIT, 0.25),
    ):
        found = load_gait(path)
        ground = Ground(mu_s=mu)
        s = PlanarWalk(model, found.gait, ground=ground).run(DURATION)
        how = f"falls after {s.steps:.1f} steps" if s.fell else f"walks {s.steps:.1f} steps"
        rows[title] = (
            f"{how} at {s.speed:.3f} m/s, height {s.height_min:.3f} to {s.height_max:.3f} m, pitch up to "
            f"{s.pitch_max:.3f} rad, slip {s.slip:.2f} mm per step, thrust {s.thrust_rms:.1f} N"
        )
        if path != PAPER_CURVES_GAIT and mu == 0.25:
            name = title.split(",")[0]
            rows[f"{name}, found by"] = str(found.record.get("command", "unknown"))
            for memory, kind in ((False, "without the PID's integrals"), (True, "with them")):
                p = analyse_periodicity(model, found.gait, ground=ground, memory=memory)
                rows[f"{name}, spectral radius of the Poincaré map, {kind}"] = (
                    f"{p.spectral_radius:.3f} ({p.spread[0]:.3f} to {p.spread[1]:.3f} over the difference steps), "
                    f"residual of the fixed point {p.residual:.1e}"
                )
    return rows
