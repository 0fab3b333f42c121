"""Benchmarks: protocols that are frozen, run and summed up."""
