"""Composes drivers, calibration and core: command line, experiments, jobs, service, reports."""
