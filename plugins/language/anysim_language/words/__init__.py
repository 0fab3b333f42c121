"""The vocabulary that comes with anysim: `english.yaml`, data alone."""
