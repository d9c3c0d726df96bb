"""FMUs of blocks: model description, documentation, icons."""
