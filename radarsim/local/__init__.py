"""Simulations that run in the same process as the program that drives the robots."""

from radarsim.local.robot import Frame, LocalRobot, LocalScan
from radarsim.local.simulation import LocalSimulation, simulate

__all__ = ["Frame", "LocalRobot", "LocalScan", "LocalSimulation", "simulate"]
