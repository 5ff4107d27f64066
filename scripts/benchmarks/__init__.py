"""What the benchmark scripts share: clips, fresh processes, tools, time errors, tables, figures."""
