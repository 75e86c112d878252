"""Things without end: random objects in the classes of a household and workshop, made of convex pieces."""
