"""Constants of nature that several packages need."""

GRAVITY = 9.81
"""Acceleration of gravity [m/s^2], as in the paper's Table 1."""
