"""Live view: worlds, tasks and recordings in a browser, drawn from the neutral model on any engine."""
