"""The whole method: `scenes` completes views and removes objects, `pairs` does the same for stereo, `recipes` says how."""
