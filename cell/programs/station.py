"""The station: the only place that chooses between real and simulated devices."""
