"""The annotators of this distribution, one file each."""
