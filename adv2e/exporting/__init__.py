"""Training sets and representations, made from recordings and simulated events alike."""
