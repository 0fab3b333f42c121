"""External benchmarks: environments of other projects, evaluated as our own tasks are."""
