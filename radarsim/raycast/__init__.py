"""What a ray meets: Embree behind one door, and the penetration of what it finds."""
