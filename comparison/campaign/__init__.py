"""Many seeded walks over friction, pushes and model errors, the same for every controller, on a cluster of processes.

:mod:`~comparison.campaign.plan` says which walks, :mod:`~comparison.campaign.walks` does one,
:mod:`~comparison.campaign.store` keeps what is done, :mod:`~comparison.campaign.execute` has them done, and
:mod:`~comparison.campaign.summary` says what came out; :func:`~comparison.campaign.run.run_campaign` does all of it.
"""
