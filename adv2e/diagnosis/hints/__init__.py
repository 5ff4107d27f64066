"""Starting values of fits, read off a recording: flicker, frame readout, arbiter times."""
