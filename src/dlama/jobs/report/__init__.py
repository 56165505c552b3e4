"""A finished or running batch in; one HTML page about it out. Begin with `write`."""
