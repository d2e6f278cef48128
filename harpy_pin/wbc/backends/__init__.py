"""Solvers behind one small interface, one file each; all but ProxQP are optional to install.

PIQP, OSQP, Clarabel and quadprog are here to be compared with, so they must not be slower than they are. Called through
qpsolvers instead, to the same accuracy, their median solve took longer on the same 500 programs in one run (least and
most over the three formulations): PIQP 1.5 to 1.7 times (60 µs more), Clarabel 1.2 to 1.4 times (100 to 320 µs, mostly
sparse conversion), quadprog 1.6 to 2.2 times (40 to 46 µs), OSQP 2.7 to 8 times, since qpsolvers sets it up anew for
each program and its warm start and its pattern are lost. Each therefore keeps a file of its own.
"""
