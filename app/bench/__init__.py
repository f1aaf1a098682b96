"""Benchmarks behind `airlens bench`: one module each; `register(bench)` in each adds it."""
