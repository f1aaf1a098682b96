"""Estimate a room from measurements: prior, observation operator, fit, posterior, diagnostics.

The model of the room is `core.room`; `core.solve.room` runs the whole estimation. README.md has the method.

Reading order:

    what is estimated   balance, plane_openings, prior
    what is measured    observation
    forward runs        journal, marches, forward_runs, schedule
    the fit             least_squares, parameter_names, parameter_step, parameter_fit
    the last level      discrepancy, temperature_levels
    other rooms         unstated_heat, alternatives
    the result          image_noise, explained, model_error, uncertainty, posterior, diagnostics
"""
