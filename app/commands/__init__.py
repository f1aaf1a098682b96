"""The command line, one module a command; `register(app)` in each adds it. Thin: parse, call, print."""
