"""What was found, written out: a page, a record for programs, the model, a summary.

Diagnoses of recordings and of tables are written by the same parts.  Imports point one way:
``diagnosis.outcome.report`` and ``diagnosis.tables.report``, which know what their pages hold,
import from here, and nothing here imports from them.
"""
