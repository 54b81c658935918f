"""Trained chains that come with the package: the policies alone, sealed like any checkpoint."""
