"""Ray Jobs over REST: the distributed engine. No Ray library is needed here, and nothing is unpickled.

Of Ray only the starting, stopping and reporting of a process is used: the queue, the retries and the
fence stay with the ledger. The head must ask for a token (`RAY_AUTH_MODE=token`): one that answers
without it would run anybody's commands, and is refused.
"""

import shlex
from pathlib import Path
from typing import Any

import httpx

from app.jobs.config import RayConfig
from app.jobs.engines.engine import Launch, ProcessState
from app.jobs.errors import EngineError

_STATES = {
    "PENDING": ProcessState.pending,
    "RUNNING": ProcessState.running,
    "STOPPED": ProcessState.gone,
    "SUCCEEDED": ProcessState.gone,
    "FAILED": ProcessState.gone,
}
_TIMEOUT_S = 10.0


class RayEngine:
    """Jobs of one Ray head. The handle is the submission id, which is the attempt's name."""

    name = "ray"

    def __init__(self, config: RayConfig) -> None:
        self._config = config
        # `trust_env=False`: no proxy of the environment gets to see the token.
        self._client = httpx.Client(base_url=config.address, timeout=_TIMEOUT_S, trust_env=False)

    def probe(self) -> None:
        """Raise EngineError unless the head refuses strangers and knows us."""
        stranger = self._send("GET", "/api/jobs/", token=False)
        if stranger.status_code != httpx.codes.UNAUTHORIZED:
            raise EngineError(
                f"The Ray head at {self._config.address} answered {stranger.status_code} to a request "
                "without a token; 401 was expected. Anyone could run commands there. Start it with "
                "RAY_AUTH_MODE=token and a token file."
            )
        self._checked("GET", "/api/jobs/")

    def start(self, launch: Launch) -> str:
        """Submit the worker. A submission that was repeated after a crash finds the first one."""
        body = {
            "entrypoint": f"exec {shlex.join([self._config.python, *launch.worker_arguments])}",
            "submission_id": launch.name,
            "entrypoint_num_cpus": self._config.cpus_per_job,
            "entrypoint_num_gpus": self._config.gpus_per_job,
            "entrypoint_memory": launch.memory_bytes,
            "metadata": {"job": launch.job, "attempt": str(launch.attempt)},
        }
        response = self._send("POST", "/api/jobs/", json=body)
        # A submission id that is already there answers 500.
        if response.is_error and self.find(launch) is None:
            raise EngineError(
                f"Ray did not take {launch.name}: status {response.status_code}, {response.text[:300]!r}. "
                "Read the head's log; the job is tried again."
            )
        return launch.name

    def find(self, launch: Launch) -> str | None:
        """Return the submission id when the head knows it."""
        response = self._send("GET", f"/api/jobs/{launch.name}")
        return launch.name if response.is_success else None

    def state(self, handle: str) -> ProcessState:
        """Ask the head. It notices a lost node by itself."""
        response = self._send("GET", f"/api/jobs/{handle}")
        if response.status_code == httpx.codes.NOT_FOUND:
            return ProcessState.gone
        if response.is_error:
            raise EngineError(f"Ray answered {response.status_code} for {handle}: {response.text[:200]!r}.")
        return _STATES.get(response.json()["status"], ProcessState.unknown)

    def exit_status(self, handle: str) -> int | None:
        """Return the status that the head noted, if it did."""
        response = self._send("GET", f"/api/jobs/{handle}")
        return response.json().get("driver_exit_code") if response.is_success else None

    def stop(self, handle: str, *, kill: bool = False) -> None:
        """Ask Ray to stop the process: SIGTERM, and SIGKILL after `RAY_JOB_STOP_WAIT_TIME_S`."""
        self._send("POST", f"/api/jobs/{handle}/stop")

    def close(self) -> None:
        """Close the connections to the head."""
        self._client.close()

    def _checked(self, method: str, path: str) -> httpx.Response:
        response = self._send(method, path)
        if response.is_error:
            raise EngineError(
                f"The Ray head at {self._config.address} answered {response.status_code} to {path}. "
                f"Check that {self._config.token_file} holds the head's token."
            )
        return response

    def _send(self, method: str, path: str, *, token: bool = True, json: Any = None) -> httpx.Response:
        headers = {"Authorization": f"Bearer {self._token()}"} if token else {}
        try:
            return self._client.request(method, path, headers=headers, json=json)
        except httpx.HTTPError as error:
            raise EngineError(
                f"The Ray head at {self._config.address} cannot be reached ({type(error).__name__}). "
                "Start it, or correct `address` in jobs.toml."
            ) from error

    def _token(self) -> str:
        path = Path(self._config.token_file).expanduser()
        try:
            return path.read_text(encoding="ascii").strip()
        except (OSError, UnicodeDecodeError) as error:
            raise EngineError(
                f"The Ray token could not be read from {path}. Write the head's token there (mode 600), "
                "or correct `token_file` in jobs.toml."
            ) from error
