"""FMUs of blocks: model description, documentation, portraits, package."""
