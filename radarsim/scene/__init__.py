"""Scenes: materials, parts and start poses, and the map files that define them."""
