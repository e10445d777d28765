"""Simultaneous localisation and mapping: a Rao-Blackwellised particle filter with grid maps."""
