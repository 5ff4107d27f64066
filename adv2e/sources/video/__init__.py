"""Video files: pictures, times and what the file states of its light."""
