"""Settings and samples in; a trained network in a run directory out. Begin with `train`."""
