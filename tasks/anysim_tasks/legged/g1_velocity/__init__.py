"""Walk as fast as commanded, on two legs, by positions of the joints."""
