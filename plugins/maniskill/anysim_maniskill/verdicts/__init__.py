"""Agreement of verdicts: a task's success and that of a peer's task, judged on the same states."""
