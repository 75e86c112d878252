"""Inference over hand configurations: potential, MAP, samples."""
