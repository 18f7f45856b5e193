"""Ray tracing: intersection by Embree, and attenuation in what rays penetrate."""
