"""HDF5 in the layout of ``event_utils`` and ``event_cnn_minimal`` (Monash University)."""
