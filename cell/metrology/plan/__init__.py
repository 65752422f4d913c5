"""Where the robot stands before every hole, and how it gets there."""
