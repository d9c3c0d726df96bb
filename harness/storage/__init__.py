"""Files and folders: written whole or not at all, unpacked with limits, kept in a cache, removed after use."""
