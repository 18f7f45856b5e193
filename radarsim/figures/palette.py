"""Colours of figures."""

RADAR_COLOUR, LASER_COLOUR = "#0b5cad", "#8e3a8c"
DUST_COLOUR = "#f0e2bf"
NOISE_COLOUR = "#d55e00"
QUIET = "0.4"
