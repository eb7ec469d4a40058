"""Robustness campaigns."""
