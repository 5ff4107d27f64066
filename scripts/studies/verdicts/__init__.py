"""What the study of ``adv2e diagnose`` is made of: cases, results, runs, scores, tables, figure."""
