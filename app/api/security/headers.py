"""Security headers of every answer. Scripts come from the service's own files only, under Trusted Types."""

from collections.abc import Mapping
from functools import cache

PAGE_POLICY = "; ".join(
    [
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' blob: data:",
        "connect-src 'self'",
        "font-src 'self'",
        "manifest-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
        "require-trusted-types-for 'script'",
        "trusted-types svelte-trusted-html",
    ]
)
DATA_POLICY = "default-src 'none'; frame-ancestors 'none'; sandbox"
# A report is a page made from data: it may be looked at, but runs nothing and reaches nothing.
REPORT_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'; sandbox"
)
COMMON = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-embedder-policy": "require-corp",
    "x-frame-options": "DENY",
    "permissions-policy": "camera=(), microphone=(), geolocation=(), payment=(), usb=(), serial=()",
}


def headers_for(path: str) -> Mapping[str, str]:
    """Return the headers that an answer from `path` carries unless its route set its own."""
    return _data() if path.startswith("/api") else _page(path.startswith("/assets/"))


@cache
def _data() -> Mapping[str, str]:
    return {**COMMON, "content-security-policy": DATA_POLICY, "cache-control": "no-store"}


@cache
def _page(hashed: bool) -> Mapping[str, str]:
    # The names of built assets carry a hash of their content.
    caching = "public, max-age=31536000, immutable" if hashed else "no-cache"
    return {**COMMON, "content-security-policy": PAGE_POLICY, "cache-control": caching}
