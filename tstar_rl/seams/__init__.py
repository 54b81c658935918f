"""What happens where one skill hands over to the next, measured: what decides, and which skill can change it."""
