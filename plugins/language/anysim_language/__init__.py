"""Words for what a world holds and what happened in it: descriptions, and questions with answers that are verified."""
