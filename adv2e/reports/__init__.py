"""What was found in a recording or a table, written out: page, record, model, summary."""
