"""Doors to eyes."""
