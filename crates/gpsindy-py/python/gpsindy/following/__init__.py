"""What follows a diagnosis: consequences, ranges for training, the corrected MJCF, the next experiment."""
