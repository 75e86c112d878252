"""PyBullet as a second physics engine of the lift test."""
