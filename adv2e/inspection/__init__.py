"""What a file holds, as one dictionary and as text for people."""
