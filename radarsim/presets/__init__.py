"""The shipped sensors and robots: YAML files, and what reads them."""
