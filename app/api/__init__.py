"""The HTTP service: `factory.create_app(config)` builds it; nothing is kept in module globals."""
