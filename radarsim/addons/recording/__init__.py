"""Records runs as ROS 2 bags, reads the bags, and replays or repeats the runs."""
