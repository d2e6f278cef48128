"""One search for the settings of every contender: the same budget, the same objective, the same walks.

:mod:`~comparison.tuning.variants` says who is tuned, and within which ranges; :mod:`~comparison.tuning.training` which
walks train and which judge, :mod:`~comparison.tuning.objective` what counts; :mod:`~comparison.tuning.search` proposes
settings, and :mod:`~comparison.tuning.tune` has them walked. What came out of it is in ``tuned.json``.
"""
