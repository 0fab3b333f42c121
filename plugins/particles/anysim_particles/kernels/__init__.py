"""The compiled arithmetic: one env after the other, serial, without the interpreter lock and without fast-math."""
