"""What a person reads: the report, its figures, and exports to other programs."""
