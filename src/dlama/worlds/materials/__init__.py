"""Textures: a random generator in; 256 x 256 pictures, drawn by kind, out. Begin with `palette`."""
