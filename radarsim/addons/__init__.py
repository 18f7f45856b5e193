"""Optional parts of radarsim, which add commands, sensors or observers to the core."""
