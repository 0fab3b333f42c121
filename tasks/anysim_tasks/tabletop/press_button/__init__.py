"""Press a button and hold it."""
