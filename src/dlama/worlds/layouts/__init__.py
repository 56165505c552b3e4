"""A seed in; a random street or room, set out with props, out. Begin with `random_scene`; `floor_plan` keeps things apart."""
