"""Is the posterior right? Coverage, SBC, TARP, reliability."""
