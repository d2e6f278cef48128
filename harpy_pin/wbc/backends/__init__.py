"""Solvers behind one small interface, one file each; all but ProxQP are optional to install.

PIQP, OSQP, Clarabel and quadprog serve the comparison, which must not slow them down. Through qpsolvers, to the same
accuracy on the same 500 programs, their median solve took longer: PIQP 1.5 to 1.7 times, Clarabel 1.2 to 1.4 times,
quadprog 1.6 to 2.2 times, OSQP 2.7 to 8 times (over the three formulations). So each has a file here.
"""
