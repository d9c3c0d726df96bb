"""What is written of blocks, systems and laws: FMUs, WebAssembly, C; `targets` has one module for each."""
