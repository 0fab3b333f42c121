"""Assets: files and builders, read into one imported model."""
