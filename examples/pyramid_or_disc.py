"""Slip of the condensed controller with a friction pyramid of eight faces, and with Coulomb's disc itself."""

import harpy_pin as hp

SIDEWAYS = hp.Push(0.9, (0.0, 4.0, 0.0))

print("slip, mm per step; without and with a push of 4 N·s")
print("friction  pyramid     disc  pyramid     disc")
for mu in (0.12, 0.15, 0.2, 0.25, 0.4, 0.8):
    slips = []
    for pushes in ((), (SIDEWAYS,)):
        for cone in ("pyramid", "disc"):
            scenario = hp.Scenario(
                controller=hp.Condensed(parameters={"limits": {"cone": cone}}),
                ground=hp.Ground(mu_s=mu),
                disturbances=hp.Disturbances(pushes=pushes),
                duration=5.0,
            )
            slips.append(hp.measure(hp.walk(scenario)).slip_mm_per_step)
    print(f"{mu:8.2f}" + "".join(f"{slip:9.3f}" for slip in slips))
