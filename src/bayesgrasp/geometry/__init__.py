"""Rotations, the grasp space R^3 x SO(3) x G, and cameras."""
