"""A planner behind HTTP: what a request may hold, one plan for each, limits, and numbers of how it goes."""
