"""What scripts write: tables, figures, files."""
