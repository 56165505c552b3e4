"""Where samples come from: photos, data sets, worlds and packs in; batches out. Begin with `sources`, then `loader`."""
