"""A simulation in the process of the program that drives its robots."""

from radarsim.local.robot import Frame, LocalRobot, LocalScan
from radarsim.local.simulation import LocalSimulation, simulate

__all__ = ["Frame", "LocalRobot", "LocalScan", "LocalSimulation", "simulate"]
