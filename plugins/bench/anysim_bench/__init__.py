"""Benchmarks of the command line: the cost of anysim on top of the engine."""
