"""Pull a cube nearer with a hook."""
