"""Tools for agents: what a language model can ask of worlds and episodes, and the server that offers it."""
