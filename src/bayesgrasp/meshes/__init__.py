"""Meshes as they come from files, cut into convex parts, and how they rest on a table."""
