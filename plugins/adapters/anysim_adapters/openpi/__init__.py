"""openpi's protocol: policies of anysim for its clients."""
