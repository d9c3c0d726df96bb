"""The native engine: each mechanism in C, and beside it its Python side."""
