"""A verb under way in; bars, warnings, errors, flags and results as text on the shell's streams out. Begin with `output`."""
