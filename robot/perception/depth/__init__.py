"""Disparity from a rectified pair: several matchers behind one contract."""

from robot.perception.depth.base import Depth
from robot.perception.depth.make import make_depth

__all__ = ["Depth", "make_depth"]
