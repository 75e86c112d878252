"""Depth images as they come from users: files, cameras, the canonical view, the table and the object in it."""
