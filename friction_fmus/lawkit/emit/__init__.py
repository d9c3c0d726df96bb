"""C code from casadi expressions."""
