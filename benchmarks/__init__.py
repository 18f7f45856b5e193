"""Benchmarks of the ray engine and the server: ``python -m benchmarks``."""
