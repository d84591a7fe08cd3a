"""Readers of foreign logs, the mapping file and the list of channels; `scripts/import_log.py` is the command."""
