"""Many seeded walks, the same for every controller, over whatever may go wrong.

:mod:`~comparison.campaign.settings` says how many and what varies, :mod:`~comparison.contenders` who walks;
:mod:`~comparison.campaign.plan` draws the walks, :mod:`~comparison.campaign.walks` does one,
:mod:`~comparison.campaign.store` keeps what is done, :mod:`~comparison.campaign.execute` has them done.
:mod:`~comparison.campaign.summary` says what came out, :mod:`~comparison.campaign.exceptions` when a whole-body
controller falls where others stand, and why.
"""
