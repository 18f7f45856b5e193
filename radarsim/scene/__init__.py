"""What there is: materials, parts, start poses, and the map files they come from."""
