"""Selection of the effects that are added to the model, validated on held-out data."""
