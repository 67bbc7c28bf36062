"""Measurements of gyroid_cad: how close, how fast, how small. ``python -m benchmarks`` prints every table."""
