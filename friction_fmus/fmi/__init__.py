"""FMUs of blocks: description, documentation, portraits, package."""
