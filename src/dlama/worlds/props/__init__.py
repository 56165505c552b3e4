"""Objects of a scene: a builder at a place, a palette and a random generator in; shapes added to the builder out."""
