"""Ray casting: a stage's shapes, texels, a light and a camera in; colour, depth and what was hit out. Begin with `stage`."""
