"""Studies of the simulator and of the diagnosis, on made-up scenes."""
