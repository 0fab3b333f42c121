"""Evaluation: policies by name, how often they solve a task, and whether engines agree."""
