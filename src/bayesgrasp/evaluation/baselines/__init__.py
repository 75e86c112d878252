"""Strategies that need no learning, for comparison."""
