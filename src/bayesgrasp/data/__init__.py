"""Simulated tuples: what they are, how they are kept, and how they are read."""
