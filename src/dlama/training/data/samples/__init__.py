"""Photos, data sets and worlds in -> training samples out, one file per origin. Begin with `views`."""
