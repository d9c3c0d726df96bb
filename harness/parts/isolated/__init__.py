"""FMUs in their own process: the part, its process, the channel between them, and the code that runs there."""
