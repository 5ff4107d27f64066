"""The effects, one module each, by stage: frames, pixel, readout."""
