"""A room solver: the Boussinesq equations on a staggered grid, marched to a steady state, differentiable.

Reading order: grid, boundary, transport, momentum, pressure, closure, model, level, march, setup, vertices.
"""
