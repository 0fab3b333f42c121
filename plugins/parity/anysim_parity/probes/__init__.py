"""Small Worlds with known answers: each probe is one of them, what is measured in it, and what it should be."""
