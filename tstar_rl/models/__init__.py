"""The networks and what their inputs pass through."""
