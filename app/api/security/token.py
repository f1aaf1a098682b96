"""The service's token: random, in a file that only its owner can read, never an argument or a log line."""

from pathlib import Path

from app.api.security.settings import new_token
from app.errors import BadInputError
from app.files.durable import write_durably


def service_token(data_root: Path, renew: bool = False) -> str:
    """Return the token kept in `data_root`, made at the first start so that a restart keeps open pages.

    `renew` makes a new one: every cookie and every program that used the old one is shut out.
    Raises BadInputError when others can read the file.
    """
    path = data_root / "service" / "token"
    if renew or not path.exists():
        write_durably(path, _write_private)
    if path.stat().st_mode & 0o077:
        raise BadInputError(f"Others can read {path}. Run `airlens serve --new-token` to replace the token.")
    return path.read_text(encoding="ascii").strip()


def _write_private(path: Path) -> None:
    path.chmod(0o600)
    path.write_text(new_token() + "\n", encoding="ascii")
