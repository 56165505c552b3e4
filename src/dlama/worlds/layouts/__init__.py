"""Random scenes: a seed in; a stage with ground, walls and props set out on it out. Begin with `random_scene`."""
