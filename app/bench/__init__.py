"""Benchmarks behind `airlens bench`: one module each; `register(bench)` in each adds it.

A new benchmark is a module here and a line in `BENCHES`: its name, its module, and its first sentence.
"""

BENCHES = {
    "calibrate": (
        "app.bench.calibrate",
        "Measure this machine once, a few minutes, so that plans predict time and memory.",
    ),
    "draft": ("app.bench.draft", "T beside the trivial answer, with a printed and with a projected pattern."),
    "openfoam": (
        "app.bench.openfoam",
        "A room by airlens' own march and by OpenFOAM (where it is installed), both from rest on the same cells.",
    ),
    "placement": (
        "app.bench.placement",
        "Share of the signal that a projector-lit wall keeps, by stand-off and baseline.",
    ),
    "predict": (
        "app.bench.predict",
        "Hold the plan's predictions against what then happens, on rooms that they were not fitted to.",
    ),
    "rays": (
        "app.bench.rays",
        "Error against float64 and CPU time of each tracer, forward and with gradient.",
    ),
    "reconstruct": (
        "app.bench.reconstruct",
        "Error against time of `grid` and `mlp` on one volume, in one run.",
    ),
    "regimes": (
        "app.bench.regimes",
        "Each regime of losses on one volume: errors of T, p, u, and pictures of truth, prediction and error.",
    ),
    "room": ("app.bench.room", "Heated and lid-driven cavities against published values."),
    "room-cost": (
        "app.bench.room_cost",
        "Processor seconds, memory and derivatives of a march to the steady state.",
    ),
    "room-fit": (
        "app.bench.room_fit",
        "Errors of T, u and p, and the share of points within their 95 % intervals.",
    ),
    "room-flows": (
        "app.bench.room_flows",
        "A plane jet's spreading rate and a tall heated cavity's profiles against measurements.",
    ),
    "tradeoff": (
        "app.bench.tradeoff",
        "Sweep presets, sizes, frames and light over rooms; find what is best at each price.",
    ),
    "world": (
        "app.bench.world",
        "T and u, and the share of points within their 95 % intervals, nuisance by nuisance.",
    ),
}
