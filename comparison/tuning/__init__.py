"""One search for the settings of all: every variant gets the same budget on the same walks.

:mod:`~comparison.contenders` says who is tuned, within which ranges; :mod:`~comparison.tuning.tune`
on which walks, what counts, and which settings are proposed. What was found is in ``tuned.json``.
"""
