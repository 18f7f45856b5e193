"""What judges runs of the program: benchmarks. Sits above what it measures."""
