"""Many walks of drawn scenarios, the same for every contender.

:mod:`~comparison.campaign.plan` says how many and what varies, and draws the walks,
:mod:`~comparison.contenders` who walks; :mod:`~comparison.campaign.walks` does them,
:mod:`~comparison.campaign.store` keeps what is done, :mod:`~comparison.campaign.summary` says what
came out.
"""
