"""Process of the command: signals, standard streams, cleanup, limits of the machine."""
