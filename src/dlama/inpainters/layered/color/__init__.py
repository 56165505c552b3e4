"""A view with depth and surface labels in; its hole painted with texture of the same surface out. See `texture_synthesis`."""
