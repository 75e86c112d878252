"""Pictures and films of objects and attempts."""
