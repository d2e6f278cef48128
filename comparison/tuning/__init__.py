"""One search for the settings of all: every variant gets the same budget on the same walks.

:mod:`~comparison.tuning.variants` says who is tuned, within which ranges, and what was found;
:mod:`~comparison.tuning.tune` on which walks, what counts, and which settings are proposed.
"""
