"""Reports of a diagnosis: HTML page, JSON record, model as YAML, summary for the terminal."""
