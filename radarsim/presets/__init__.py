"""The shipped sensors, materials and robot classes: YAML files and their loaders."""
