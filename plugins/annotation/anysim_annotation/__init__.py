"""Annotations of cameras: what is seen, in arrays and records, of recorded episodes and of live worlds."""
