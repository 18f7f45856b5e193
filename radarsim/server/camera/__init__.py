"""What a robot's camera sees: a scene drawn by the ray engine."""
