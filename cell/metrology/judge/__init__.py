"""From measured points to deviations and verdicts."""
