"""Demonstrations: the data set, its file format and checks, and collecting them from the scripted assembler."""
