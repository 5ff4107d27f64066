"""The layout of the Event-Camera Dataset (DAVIS240C): a folder or a zip archive."""
