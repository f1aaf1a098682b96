"""What several benchmarks share; the folder above holds one module a command."""
