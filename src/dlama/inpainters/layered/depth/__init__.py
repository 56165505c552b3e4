"""Known surfaces of a view in; depth and surface label of every hole pixel out. See `surfaces`, then `surface_labels`."""
