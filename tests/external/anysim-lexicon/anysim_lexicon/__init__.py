"""Words of a kitchen: `kitchen.yaml`."""
