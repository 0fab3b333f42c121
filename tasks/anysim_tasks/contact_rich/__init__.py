"""Tasks of contact: taps, pegs, plugs and switches, for a Panda at a table."""
