"""Declared experiments: their arms and seeds, the steps that these take, and the publishing of their tables."""
