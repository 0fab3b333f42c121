"""The compiled arithmetic: scalar loops over envs, without the interpreter lock, an env's bits its own."""
