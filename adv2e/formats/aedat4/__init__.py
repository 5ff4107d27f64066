"""AEDAT4, the format of iniVation's DV, jAER's successor, for events and frames."""
