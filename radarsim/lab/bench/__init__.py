"""Benchmarks of the ray engine and the server."""
