"""Calibration: boards, cameras, IMU, wheels, mounting and synchronisation, from data to numbers."""
