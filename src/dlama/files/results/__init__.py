"""A completion in; a directory of named results and its preview out. Begin with `completion`."""
