"""Printers, and the check of what they can print."""
