"""Evaluation of runs against the ground truth: trials, path lengths, map scores."""
