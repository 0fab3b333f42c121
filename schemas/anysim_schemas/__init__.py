"""The specs of anysim and the loader that reads them from YAML. Importing this package imports nothing heavy."""

__version__ = "0.1.0"
