"""Estimate a room from measurements: prior, observation operator, fit, posterior, diagnostics."""
