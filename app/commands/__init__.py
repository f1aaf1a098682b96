"""The command line, one module a command; `register(cli)` in each adds it. Thin: parse, call, print.

A new command is a module here and a line in `COMMANDS`: its name, its module, and its first sentence. The order is
that of the work: what `airlens` alone lists.
"""

COMMANDS = {
    "demo": (
        "app.commands.demo",
        "The whole chain on a packaged room: simulate a lab's rig, capture, reconstruct, report.",
    ),
    "new": (
        "app.commands.new",
        "Make an experiment for your rig and room: asked question by question, or from a file of answers.",
    ),
    "devices": (
        "app.commands.devices",
        "List cameras with their formats and controls, and serial ports.",
    ),
    "preview": (
        "app.commands.preview",
        "Take one frame; print its level, contrast, focus and saturation with advice.",
    ),
    "plan": (
        "app.commands.plan",
        "Say what this rig would see of this room, at what price, and what would help: before measuring.",
    ),
    "print": (
        "app.commands.print",
        "Write the wall's pattern, or a board to calibrate with, as a PDF at true scale.",
    ),
    "projector": (
        "app.commands.projector",
        "Speak to a projector.",
    ),
    "kiosk": (
        "app.commands.kiosk",
        "Show pictures on projectors by pages in their browsers, or by a card, and say when they are there.",
    ),
    "calibrate": (
        "app.commands.calibrate",
        "Calibrate camera, projector, wall and response: live on the experiment's rig, guided, or from --images.",
    ),
    "capture": (
        "app.commands.capture",
        "Take bursts with the rig, or watch the shift live.",
    ),
    "import": (
        "app.commands.importing",
        "Make captures of pictures that another camera took: TIFF, PNG, JPEG, or raw files (by airlens[raw]).",
    ),
    "reconstruct": (
        "app.commands.reconstruct",
        "Reconstruct the air from the newest reference and flow captures.",
    ),
    "report": (
        "app.commands.report",
        "Write the report of a result: one HTML file that needs no network, or two pages of PDF.",
    ),
    "export": (
        "app.commands.report",
        "Write a result for another program: NetCDF, ParaView, CSV, OpenFOAM, a picture, a surface, paths.",
    ),
    "indoor": (
        "app.commands.indoor",
        "Say what the found air means for people and ventilation: draught, PMV, air change, heat, with intervals.",
    ),
    "score": (
        "app.commands.score",
        "Compare the newest result with a known room, beside the trivial answers.",
    ),
    "status": (
        "app.commands.status",
        "Say what an experiment has, and which command comes next.",
    ),
    "serve": (
        "app.commands.serve",
        "Serve the operator's page and the API; prints the address with its token.",
    ),
    "remote": (
        "app.commands.remote",
        "Ask a running service; without a request, list what can be asked.",
    ),
    "jobs": (
        "app.commands.jobs",
        "Queue, watch, stop and resume computations.",
    ),
    "displacement": (
        "app.commands.displacement",
        "Estimate the shift field between two pictures (TIFF or PNG), with its uncertainty.",
    ),
    "simulate": (
        "app.commands.simulate",
        "Make a complete experiment from a room volume: scene, calibration, reference and flow captures.",
    ),
    "schema": (
        "app.commands.schema",
        "Print the JSON Schema of experiment.toml, or of the answers, for editors.",
    ),
    "bench": (
        "app.commands.bench",
        "Measure speed and the error that it bought.",
    ),
}
