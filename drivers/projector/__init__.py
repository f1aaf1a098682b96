"""Projectors: one Protocol, dialects as pure bytes in and bytes out, serial and network transport."""
