"""Which effects are added to the model, validated on data that they were not fitted to."""
