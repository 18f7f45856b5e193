"""What judges runs of the program: benchmarks. Sits above everything that it measures."""
