"""Tactile sensors: taxels on a body, the forces on them, and images of what presses into a gel."""
