"""A data set and methods in; every case run by every method, stored and resumed, out. Begin with `run`."""
