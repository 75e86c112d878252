"""Whole pieces of work, from trained weights to a planner, from data to a model: where all rooms are joined."""
