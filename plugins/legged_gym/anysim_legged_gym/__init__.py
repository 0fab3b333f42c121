"""The simulator interface of legged-gym training code, for any engine and any legged robot of the catalogue."""
