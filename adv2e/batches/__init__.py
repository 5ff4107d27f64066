"""Many conversions: what is converted, what was done already, and who does it."""
