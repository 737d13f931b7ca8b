"""Where the robot is and what stands where: EKF-SLAM over landmarks seen in stereo."""
