"""Films of recorded episodes: videos drawn from recorded states, as they would have been or otherwise."""
