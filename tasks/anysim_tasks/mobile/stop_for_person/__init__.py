"""Drive on, and stop in time for a person who steps into the way."""
