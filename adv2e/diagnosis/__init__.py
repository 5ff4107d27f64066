"""What a recording holds that its simulation lacks: residual, cause, and the model that has it."""
