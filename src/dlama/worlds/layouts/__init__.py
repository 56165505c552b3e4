"""A seed in; a random street or room with props in it out. Begin with `random_scene`; `floor_plan` finds free places."""
