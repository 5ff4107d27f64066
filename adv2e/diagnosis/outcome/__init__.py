"""What a search found: verdict, errors, pictures, report."""
