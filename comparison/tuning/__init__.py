"""One search for the settings of every contender: the same budget, the same objective, the same walks.

:mod:`~comparison.tuning.variants` says who is tuned, and within which ranges; :mod:`~comparison.tuning.walks` which
walks train and which judge, and what counts; :mod:`~comparison.tuning.tune` proposes settings and has them walked. What
came out of it is in ``tuned.json``.
"""
