"""Analytic priors: hand configurations, scenes, nuisances."""
