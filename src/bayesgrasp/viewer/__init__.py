"""Pictures for people: objects and attempts, by ray casting."""
