"""The neutral model: what every engine builds from, and questions about it that need no engine."""
