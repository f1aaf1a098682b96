"""What crosses the API: its models, apart from the routes, so that a client needs nothing of the service."""
