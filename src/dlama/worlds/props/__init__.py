"""Things to stand in a scene: a stage, a palette and a random generator in; shapes on the stage out."""
