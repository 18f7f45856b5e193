"""Ray tracing: intersection with Embree, and attenuation in penetrable materials."""
