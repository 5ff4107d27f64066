"""Which effects are added to the model, judged on data that they were not fitted to."""
