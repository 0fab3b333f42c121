"""The catalogue on every engine: what was measured, as a file, a table, a page and contact sheets."""
