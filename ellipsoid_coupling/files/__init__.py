"""Bytes on disk: open, check, seal, bound and write; what any other part may use."""
