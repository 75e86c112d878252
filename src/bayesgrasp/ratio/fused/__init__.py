"""Estimators evaluated without a graph: compiled look-ups, and layers with gradients written out."""
