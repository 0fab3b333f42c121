"""Walk as fast as commanded over rough ground, which a scan of its heights shows."""
