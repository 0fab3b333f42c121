"""Keep what flies about in the middle of the image."""
