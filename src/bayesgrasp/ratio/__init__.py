"""Likelihood-to-evidence ratio estimators and their training."""
