"""Methods of identification that need more than the common search."""
