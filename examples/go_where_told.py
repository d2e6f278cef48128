"""Walk a course: ahead, round a corner, sideways, back, stop; print how far off it the walk was."""

import numpy as np

import harpy_pin as hp

COURSE = (
    (0.5, 0.4, 0.0, 0.0),  # from 0.5 s on 0.4 m/s ahead
    (5.0, 0.2, 0.0, np.pi / 6.0),  # a turn to the left: 90° in 3 s
    (8.0, 0.0, 0.15, 0.0),  # sideways to the left
    (11.5, -0.3, 0.0, 0.0),  # back
    (16.0, 0.0, 0.0, 0.0),  # stop
)
for controller in ("condensed", "wbc"):
    scenario = hp.Scenario(
        controller=controller,
        gait=hp.Commanded(velocity=COURSE),
        ground=hp.Ground(mu_s=0.4),
        duration=20.0,
    )
    run = hp.walk(scenario)
    error = np.linalg.norm(run["q"][:, :2] - run["x_r"][:, :2], axis=1)
    rms, slip = 1e3 * np.sqrt(np.mean(error**2)), hp.measure(run).slip_mm_per_step
    print(
        f"{controller:9} {run.ending}: {rms:.1f} mm rms off the path, slip {slip:.3f} mm per step"
    )

# The same live: the command may change at any tick.
gait = hp.make_commanded_gait(hp.load_harpy())


def steer(state: hp.State) -> None:
    """Ahead until the body has come half a metre far, then turn on the spot."""
    gait.command[:] = (0.3, 0.0, 0.0) if state.q[0] < 0.5 else (0.0, 0.0, 0.8)


run = hp.walk(hp.Scenario(controller="condensed", duration=5.0), gait=gait, on_tick=steer)
x, heading = run["q"][-1, 0], run["heading"][-1, 0]
print(f"live      {run.ending}: x = {x:.2f} m, turned to {heading:.2f} rad")
