"""SLAM on recordings of other robots: plain range-bearing sights, and orders for odometry."""

from robot.slam.survey.settings import SurveySettings
from robot.slam.survey.survey import Survey

__all__ = ["Survey", "SurveySettings"]
