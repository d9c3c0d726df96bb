"""The content of a block's file, read once for everything that needs it."""
