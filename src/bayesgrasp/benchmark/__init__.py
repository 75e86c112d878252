"""Strategies of the paper's table, judged by the lift test."""
