"""Likelihood-to-evidence ratio estimators, and the directory of a trained model."""
