"""How a found flow ventilates its room: fluxes through cells, the age of the air, heat, jets.

Reading order: `face_flow` (a flow as volume a second through cell faces, to the last digit conserved), `openings`
(what enters and leaves where), `tracer` (a passive scalar on it), `air_change` (age and effectiveness), `jet`.
"""
