"""The native engine: each mechanism in C, next to its Python side."""
