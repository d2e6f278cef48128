"""Solvers behind one small interface, one file each; all but ProxQP are optional to install."""
