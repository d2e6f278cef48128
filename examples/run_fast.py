"""Go2 runs at 3 m/s with flight, by a preview above the condensed whole-body controller."""

import numpy as np

import harpy_pin as hp
from harpy_pin.contrib.preview import Preview

go2 = hp.load_robot("go2")
motors = hp.Actuators(torque_share=1.0, no_load_share=1.0, stall_share=5.0)  # the model's limits
for plant in ("compliant", "mujoco"):
    preview = Preview(go2, ((0.0, 3.0, 0.0, 0.0), (3.5, 1.0, 0.0, 1.0)), mu=0.8)
    gait = hp.PlannedGait(go2, preview, rate=50)
    scenario = hp.Scenario(
        robot=go2,
        plant=plant,
        ground=hp.Ground(mu_s=0.8),
        disturbances=hp.Disturbances(actuators=motors),
        duration=6.0,
    )
    run = hp.walk(scenario, gait=gait)
    flight = np.mean(run["foot_force"][run["t"] > 2.0].max(axis=(1, 2)) == 0.0)
    print(f"{plant}: {run.ending}, {run['v'][:, 0].max():.1f} m/s, {100 * flight:.0f} % in flight")
