"""Demonstrations: the data set, its file format and checks, collecting them, and other libraries' formats."""
