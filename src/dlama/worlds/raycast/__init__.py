"""Rows of shapes, texels, a light and a camera in; colour, exact depth and what was hit out. Begin with `tiles.cast_rays`."""
