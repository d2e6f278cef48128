"""The search for the planar gait: its cost, its optimisation, and whether it is periodic and stable."""

from reproduction.gait.optimise import optimise_gait
from reproduction.gait.periodicity import Periodicity, analyse_periodicity
from reproduction.gait.search import SEARCHES, PlanarTask

__all__ = ["SEARCHES", "Periodicity", "PlanarTask", "analyse_periodicity", "optimise_gait"]
