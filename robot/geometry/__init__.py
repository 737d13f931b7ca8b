"""Planar poses and stereo geometry: the ground floor, imported by every room."""
