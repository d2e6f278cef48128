"""Walk Harpy under the paper's governor, then under the whole-body controller, and compare."""

import harpy_pin as hp

for name in ("governed", "wbc"):
    run = hp.walk(hp.Scenario(controller=name, ground=hp.Ground(mu_s=0.8), duration=3.0))
    measures = hp.measure(run)
    print(
        f"{name:9s} {run.ending}: {measures.distance_m:.3f} m, "
        f"slip {measures.slip_mm_per_step:.3f} mm per step, "
        f"pitch up to {measures.pitch_max_rad:.3f} rad"
    )
    # run.save("walk.npz"), then: harpy view walk.npz
