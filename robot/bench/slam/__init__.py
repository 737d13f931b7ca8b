"""`sweeper bench slam`: the EKF-SLAM on recordings, its cost and its growth."""
