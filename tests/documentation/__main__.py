"""Print each command that a document shows, and where it is run."""

from documentation.where import table

print(table())
