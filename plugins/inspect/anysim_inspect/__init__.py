"""Commands that look at what is there: a machine with its engines and plugins, a live world, draws, recordings."""
