"""What a block tells of itself in its own file, read once for everything that needs it."""
