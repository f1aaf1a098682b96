"""Options that benchmarks state alike."""

import argparse


def whole_numbers(parser: argparse.ArgumentParser, **defaults: int) -> None:
    """One option a name, `--march-steps` for `march_steps`, with its default."""
    for name, default in defaults.items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=int, default=default)
