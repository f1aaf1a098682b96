"""The HTTP service: `create_app(config)` builds it; nothing is kept in module globals."""

from app.api.factory import create_app
from app.api.security.settings import Limits, ServiceConfig

__all__ = ["Limits", "ServiceConfig", "create_app"]
