"""Maps and robot classes from files of other programs."""
