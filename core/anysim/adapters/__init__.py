"""Views of a TaskEnv in the dialects of other libraries."""
