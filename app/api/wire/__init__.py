"""What crosses the API: strict models, errors, streams, compact volumes."""
