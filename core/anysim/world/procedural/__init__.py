"""Assets that are built from parameters: one builder a file, each an entry point of the group `anysim.assets`.

A builder is a function with keyword-only parameters that returns an `ImportedModel`, as an importer does for a file.
Its annotations check what a YAML file gives it. Builders here are made of boxes, balls, cylinders and capsules alone,
so that every engine collides with the same solids, and leave gaps, so that nothing touches before anything moves.
"""
