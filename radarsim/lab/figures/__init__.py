"""The thesis' figures, drawn from runs of the program itself."""
