"""Simulation-based Bayesian inference for multi-fingered grasping."""

__version__ = "0.1.0"
