"""The command line; the only room that joins all others."""
