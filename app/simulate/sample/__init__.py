"""A sample room for the demo and the tests; see README.md beside this file."""
