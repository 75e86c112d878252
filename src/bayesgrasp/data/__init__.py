"""Simulated tuples: made, kept and fed to the trainer."""
