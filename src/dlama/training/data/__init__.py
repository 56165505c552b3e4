"""Photos, data sets and worlds in -> batches out. Begin with `sources`, then `loader`; `batches` says what a sample is."""
