"""How far two event streams are apart: distances, statistics of each, and noise floors."""
