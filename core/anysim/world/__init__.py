"""The engine-neutral world: its model, the compiler that makes it from specs, importers and assets."""
