"""What ratio estimators learn from and how: losses, objectives, the loop, and whole models."""
