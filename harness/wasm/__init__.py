"""FMUs as WebAssembly modules for JavaScript, made from those of FMI 2.0 with their sources."""

from harness.wasm.package import WasmModel, class_script, is_wasm, wasm_model, write_package

__all__ = ["WasmModel", "class_script", "is_wasm", "wasm_model", "write_package"]
