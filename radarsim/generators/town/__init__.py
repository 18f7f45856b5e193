"""A town by its seed.

`town` draws the plan and writes the map file; `buildings` and `street_furniture` say
what stands in it; a `site` takes the objects.
"""
