"""What a law is made of: declarations, equations, conditions, and the block it becomes."""
