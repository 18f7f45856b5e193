"""Measurements of the engine and the server."""
