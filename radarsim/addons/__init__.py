"""Parts that the core does without: each adds commands, sensors or observers to it."""
