"""Which device files and hosts an operator confirmed: an experiment's folder may come from anywhere.

The service itself makes simulated rigs only. Whoever copies a folder into its data could name any device file
or host in it; the service opens none before an operator saw the address and confirmed it, once.
"""

import threading
from pathlib import Path

from app.api.wire.problems import ApiError
from app.errors import BadInputError
from app.experiment.folder import Experiment
from app.files.durable import write_json
from app.files.reading import read_json

WHAT_TO_DO = "Remove the file; then every address is asked for again."


class Confirmed:
    """The confirmed addresses of every experiment, kept in one file of the service."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()

    def of(self, experiment: Experiment) -> frozenset[str]:
        """The addresses that this experiment may open."""
        lines = self._read().get(experiment.folder.name, [])
        return frozenset(map(str, lines)) if isinstance(lines, list) else frozenset()

    def check(self, experiment: Experiment) -> Experiment:
        """Return the experiment. Raises ApiError that lists the addresses that nobody confirmed."""
        asked = [a for a in experiment.settings.rig.addresses if a not in self.of(experiment)]
        if asked:
            raise ApiError(
                "unconfirmed",
                f"The experiment {experiment.folder.name} wants to open {' and '.join(asked)}.",
                current={"addresses": asked},
            )
        return experiment

    def confirm(self, experiment: Experiment, addresses: list[str]) -> None:
        """Keep that the experiment may open these too. Raises ApiError when it names another one."""
        named = experiment.settings.rig.addresses
        if not set(addresses) <= set(named):
            raise ApiError(
                "conflict",
                f"The experiment names {', '.join(named) or 'no device'}; other addresses were confirmed.",
                "Look at them again.",
            )
        with self._lock:
            known = sorted({*addresses, *self.of(experiment).intersection(named)})
            write_json(self._path, self._read() | {experiment.folder.name: known})

    def _read(self) -> dict[str, object]:
        try:
            return read_json(self._path, WHAT_TO_DO) if self._path.exists() else {}
        except BadInputError:
            return {}  # damaged: asked for again
