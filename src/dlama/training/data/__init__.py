"""Photos, data sets, worlds and packs in -> batches out. Begin with `sources`, then `loader`; `batches` says what a sample is."""
