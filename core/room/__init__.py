"""The forward model of a room: the Boussinesq equations on a staggered grid, marched to a steady state.

README.md has the equations, the scheme and the published cases that it is checked against. Reading order:

    where things are    room_grid, solids, wall_planes, openings, boundary_conditions
    one time step       transport, momentum, pressure, obstructed, k_epsilon, closure, eddies, pace, step
    a steady state      level, unrest, march
    what is seen of it  vertices, forward
"""
