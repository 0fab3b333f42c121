"""vla-eval's benchmarks: tasks of anysim among those that its harness runs."""
