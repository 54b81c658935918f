"""From YAML to objects: the schema, loading and checking a config, and what is built from it."""
