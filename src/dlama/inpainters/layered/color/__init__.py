"""A view with depth and surface labels in; smooth colours of its holes out. See `surface_colors`."""
