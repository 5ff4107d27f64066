"""What belongs to the command as a process: signals, standard streams, memory."""
