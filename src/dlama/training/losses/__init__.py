"""A network's output and its batch in -> weighted loss terms out. Begin with `terms`, the table that new terms are added to."""
