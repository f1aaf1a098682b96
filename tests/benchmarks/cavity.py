"""The heated cavity of de Vahl Davis (1983), Ra 1e3 to 1e5: mean Nusselt number of the grid and a network.

Each Rayleigh number starts from the one before. One JSON line each.

    python -m tests.benchmarks.cavity --cells 64
    python -m tests.benchmarks.cavity --method mlp --width 24
"""

import argparse
import json
import time
from collections.abc import Iterator
from typing import Any

import jax

from tests.benchmarks.options import whole_numbers
from tests.core.solve.cavity import NUSSELT, at_rest, mean_heat_flux, numbers, solve
from tests.core.solve.cavity_network import cavity_terms, descended, nusselt, start


def by_grid(cells: int) -> Iterator[tuple[float, dict[str, Any]]]:
    """Nusselt numbers, each with what else is worth knowing."""
    cavity = at_rest(cells)
    for rayleigh in NUSSELT:
        cavity = solve(cavity, rayleigh)
        yield float(mean_heat_flux(cavity, numbers(rayleigh).peclet)), {}


def by_network(width: int, points: int, steps: int) -> Iterator[tuple[float, dict[str, Any]]]:
    """The same by a network, whose loss tells how far its steps got."""
    network, terms = start(width), cavity_terms(points)
    for rayleigh in NUSSELT:
        network, loss = descended(network, terms, numbers(rayleigh), steps)
        yield nusselt(network, numbers(rayleigh)), {"loss": loss}


def main() -> None:
    """Print one JSON line a Rayleigh number."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--method", choices=("grid", "mlp"), default="grid")
    whole_numbers(parser, cells=64, width=24, points=24, steps=100)
    options = parser.parse_args()
    size = options.cells if options.method == "grid" else options.width
    with jax.enable_x64(True):
        found = (
            by_grid(options.cells)
            if options.method == "grid"
            else by_network(options.width, options.points, options.steps)
        )
        began = time.process_time()
        for (rayleigh, published), (value, more) in zip(NUSSELT.items(), found, strict=True):
            line = {"method": options.method, "size": size, "rayleigh": rayleigh}
            line |= {"nusselt": round(value, 4), "published": published}
            line |= {"error": round(value / published - 1, 5), **more}
            print(json.dumps(line | {"cpu_s": round(time.process_time() - began, 1)}), flush=True)
            began = time.process_time()


if __name__ == "__main__":
    main()
