"""Running recipes from recipes: side by side on this machine, or as tasks of a Ray cluster."""
