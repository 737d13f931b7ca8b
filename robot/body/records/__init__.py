"""What a run leaves behind: its log, its tracks and pictures, its place in the diary."""
