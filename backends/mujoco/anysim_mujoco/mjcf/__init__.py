"""The importer of MJCF files."""
