"""What a service is configured with: where its data are, who may call it, and how much they may send."""

import secrets
from dataclasses import dataclass, field
from pathlib import Path

from app.errors import BadInputError

LONGEST_SESSION_S = 30 * 86400.0
LOOPBACK = ("127.0.0.1", "localhost", "::1")


@dataclass(frozen=True)
class Limits:
    """Upper bounds; `_per_s` are sustained rates of one client address, bursts are five seconds' worth."""

    json_bytes: int = 1 << 20
    upload_bytes: int = 512 << 20
    unpacked_bytes: int = 1 << 30
    image_pixels: int = 1 << 27
    stored_uploads: int = 200
    reads_per_s: float = 2000.0
    writes_per_s: float = 50.0
    failures_per_s: float = 2.0
    parse_s: float = 30.0
    parse_memory_bytes: int = 4 << 30
    streams: int = 64
    # NIST SP 800-63B-4 asks at its first level for a new login after 30 days at most, and names no time of
    # rest. A page watches a night's run unattended: half a day's rest, a week's age.
    session_idle_s: float = 12 * 3600.0
    session_s: float = 7 * 86400.0

    def __post_init__(self) -> None:
        if not 0 < self.session_idle_s <= self.session_s <= LONGEST_SESSION_S:
            raise BadInputError(
                f"Sessions of {self.session_s:g} s that rest for {self.session_idle_s:g} s; expected a rest "
                f"above 0, no longer than the session, and that no longer than {LONGEST_SESSION_S:g} s (30 days)."
            )


def built_page() -> Path:
    """Return where the page is: inside an installed wheel, or beside the sources."""
    package = Path(__file__).resolve().parents[2]
    installed = package / "page"
    return installed if installed.is_dir() else package.parent / "web" / "dist"


@dataclass(frozen=True)
class ServiceConfig:
    """A service. `hosts` and `origins` are compared whole, never by prefix or pattern."""

    data_root: Path
    token: str = field(repr=False)
    hosts: frozenset[str]
    origins: frozenset[str]
    page_folder: Path = field(default_factory=built_page)
    cookie_name: str = "airlens"
    secure_cookie: bool = False
    limits: Limits = Limits()

    def __post_init__(self) -> None:
        if len(self.token) < 32:
            raise BadInputError(
                f"The token has {len(self.token)} characters; expected at least 32 random ones. "
                "Leave it out, and the service makes one."
            )

    @property
    def jobs_folder(self) -> Path:
        """The ledger and its jobs."""
        return self.data_root / "jobs"


def new_token() -> str:
    """Return 43 random URL-safe characters (256 bits)."""
    return secrets.token_urlsafe(32)


def service_config(
    data_root: Path,
    token: str,
    port: int,
    host: str = "127.0.0.1",
    public_url: str | None = None,
    tls: bool = False,
    limits: Limits = Limits(),
) -> ServiceConfig:
    """Return a configuration for one listening address.

    On loopback all three loopback names are accepted. `public_url` names a proxy in front of the service
    (`https://rig.example`): its host and origin are accepted too, and the cookie is then for TLS only.
    """
    scheme = "https" if tls else "http"
    secure = tls or (public_url or "").startswith("https://")
    names = LOOPBACK if host in LOOPBACK else (host,)
    hosts = {f"[{name}]:{port}" if ":" in name else f"{name}:{port}" for name in names}
    origins = {f"{scheme}://{name}" for name in hosts}
    if public_url is not None:
        origin = public_url.rstrip("/").lower()
        origins.add(origin)
        hosts.add(origin.split("://", 1)[-1])
    return ServiceConfig(
        data_root=data_root,
        token=token,
        hosts=frozenset(hosts),
        origins=frozenset(origins),
        # Cookies know no port, so the name does; __Host- keeps other hosts of the domain from setting it.
        cookie_name=f"{'__Host-' if secure else ''}airlens_{port}",
        secure_cookie=secure,
        limits=limits,
    )
