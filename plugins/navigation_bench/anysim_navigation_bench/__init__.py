"""Benchmarks of navigation: ways through furnished rooms, on maps and in physics."""
