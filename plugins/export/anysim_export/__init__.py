"""Recorded runs as the data sets that trainers read, and their actions played again."""
