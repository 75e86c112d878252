"""Doors to hardware."""
