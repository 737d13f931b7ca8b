"""The world that the simulator makes up."""

from __future__ import annotations

from robot.config.section import Fraction, NotNegative, Positive, Section


class SimConfig(Section, frozen=True):
    """The built-in simulator's imperfections. A seed draws within these limits."""

    wheel_scale_error: Fraction = 0.01
    motor_mismatch: Fraction = 0.04
    motor_lag_s: Positive = 0.07
    encoder_noise: NotNegative = 0.0005  # m of 1 sigma a square root of a metre
    slip_every_s: NotNegative = 20.0  # mean time between slips; 0: none
    slip_share: Fraction = 0.5  # at most, of the rolled distance
    gyro_bias_radps: NotNegative = 0.01
    gyro_walk: NotNegative = 1e-5  # rad/s a square root of a second
    gyro_noise_radps: NotNegative = 0.003
    image_noise: NotNegative = 2.0  # grey levels
    exposure_difference: Fraction = 0.05
    vertical_shift_px: NotNegative = 0.3
    vignetting: Fraction = 0.15
