"""A completion in; a directory of named results, what meta.json says of them, and a preview out. Begin with `completion`."""
